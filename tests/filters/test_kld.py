"""The KLD bound against golden values, and the counting of bins against a set of tuples."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from filters.kld import SAMPLE, Demand, bound


class Cloud:
    """Weighted particles, without a filter."""

    def __init__(self, columns: np.ndarray, weights: np.ndarray | None = None) -> None:
        self.columns = np.ascontiguousarray(columns, np.float32)
        self.count = self.columns.shape[1]
        self.weights = np.ones(self.count, np.float32) if weights is None else weights.astype(np.float32)


@pytest.mark.parametrize(
    ("probability", "golden"),
    [(0.90, (228, 311, 388, 461, 531, 5871)), (0.99, (462, 569, 666, 756, 843, 6733))],
)
def test_golden_values(probability: float, golden: tuple[int, ...]) -> None:
    assert tuple(bound(k, 0.01, probability) for k in (3, 4, 5, 6, 7, 100)) == golden


@pytest.mark.parametrize("bins", [5, 50, 1000])
def test_it_approximates_the_quantile_of_chi_square(bins: int) -> None:
    exact = stats.chi2.ppf(0.95, bins - 1) / (2 * 0.05)
    assert bound(bins, 0.05, 0.95) == pytest.approx(exact, rel=5e-3, abs=1)


@pytest.mark.parametrize("bins", [0, 1])
def test_one_bin_gives_the_minimum(bins: int) -> None:
    assert bound(bins, 0.05, 0.99, minimum=123) == 123


@given(st.integers(2, 100_000))
def test_more_bins_need_more(bins: int) -> None:
    assert bound(bins + 1, 0.02, 0.99) > bound(bins, 0.02, 0.99) - 1


@pytest.mark.parametrize(
    ("error", "probability"), [(0.0, 0.9), (-1.0, 0.9), (math.nan, 0.9), (0.1, 0.0), (0.1, 1.0)]
)
def test_what_makes_no_sense_is_refused(error: float, probability: float) -> None:
    with pytest.raises(ValueError, match="KLD bound"):
        bound(2, error, probability)


@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 3000),
    st.floats(0.1, 30.0),
    st.floats(0.05, 2.0),
    st.floats(0.05, 3.0),
)
@settings(max_examples=60, deadline=None)
def test_bins_are_those_of_a_set(
    seed: int, count: int, spread: float, position_bin: float, heading_bin: float
) -> None:
    rng = np.random.default_rng(seed)
    columns = np.stack(
        [rng.normal(0, spread, count), rng.normal(-500, spread, count), rng.uniform(-3.1, 3.1, count)]
    ).astype(np.float32)
    n, e, h = columns.astype(np.float64)
    occupied = set(
        zip(
            np.floor(n * (1.0 / position_bin)).tolist(),
            np.floor(e * (1.0 / position_bin)).tolist(),
            np.floor((h + math.pi) * (1.0 / heading_bin)).tolist(),
            strict=True,
        )
    )
    demand = Demand(position_bin, heading_bin)
    for _ in range(2):  # the table is not cleared between calls
        assert demand.bins(Cloud(columns)) == len(occupied)


def test_a_large_set_is_sampled_fairly() -> None:
    rng = np.random.default_rng(1)
    count = 10 * SAMPLE + 13
    columns = np.stack([np.sort(rng.uniform(0, 100, count)), np.zeros(count), np.zeros(count)])
    assert Demand(1.0, 7.0).bins(Cloud(columns)) == 100


def test_particles_without_weight_do_not_count() -> None:
    columns = np.stack([np.arange(10.0) + 0.5, np.zeros(10), np.zeros(10)])
    weights = np.where(np.arange(10) < 4, 1.0, 1e-6)
    assert Demand(1.0, 7.0).bins(Cloud(columns, weights)) == 4


def test_demand_keeps_to_its_limits() -> None:
    rng = np.random.default_rng(2)
    wide = Cloud(np.stack([rng.uniform(0, 500, 5000), rng.uniform(0, 500, 5000), np.zeros(5000)]))
    assert Demand(0.5, 1.0, minimum=50, maximum=900).particles(wide) == 900
    assert Demand(0.5, 1.0, minimum=50).particles(Cloud(np.zeros((3, 400)))) == 50


@pytest.mark.parametrize("sides", [(0.0, 1.0), (1.0, -1.0), (math.inf, 1.0)])
def test_bins_have_sides(sides: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="positive sides"):
        Demand(*sides)


def test_limits_are_ordered() -> None:
    with pytest.raises(ValueError, match="minimum"):
        Demand(1.0, 1.0, minimum=10, maximum=9)
