"""The KLD bound against golden values, and the counting of bins against a set of tuples."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from filters.kld import SAMPLE, Demand, bound
from filters.resampling import systematic


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


@pytest.mark.interpreted
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


@pytest.mark.interpreted
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


# ---- Fox's loop, before systematic resampling


def fox(cloud: Cloud, cell: float, draws: Iterator[int], minimum: int) -> int:
    """Table 8.4's loop: draw until there are as many as the bins touched ask for."""
    touched: set[tuple[int, int]] = set()
    needed, drawn = float(minimum), 0
    while drawn < needed:
        i = next(draws)
        touched.add((math.floor(cloud.columns[0, i] / cell), math.floor(cloud.columns[1, i] / cell)))
        drawn += 1
        needed = max(minimum, bound(len(touched), 0.05, 0.99, 1))
    return drawn


def spread_cloud(seed: int, count: int, sigma: float) -> Cloud:
    rng = np.random.default_rng(seed)
    columns = np.stack([rng.normal(0, sigma, count), rng.normal(7, sigma, count), np.zeros(count)])
    return Cloud(columns, rng.exponential(size=count))


def even(cloud: Cloud, uniform: float) -> Iterator[int]:
    cumulative = np.cumsum(cloud.weights, dtype=np.float64)
    golden, place = (math.sqrt(5) - 1) / 2, uniform % 1.0
    while True:
        yield int(np.searchsorted(cumulative, place * cumulative[-1], side="right"))
        place = place + golden - (1.0 if place + golden >= 1.0 else 0.0)


@given(st.integers(0, 10_000), st.integers(2, 2000), st.floats(0.3, 3.0), st.floats(1e-6, 1.0))
@settings(max_examples=25, deadline=None)
def test_draws_are_those_of_the_plain_loop(seed: int, count: int, sigma: float, uniform: float) -> None:
    cloud = spread_cloud(seed, count, sigma)
    demand = Demand(0.5, 10.0, error=0.05, probability=0.99, minimum=40)
    assert demand.draws(cloud, uniform) == fox(cloud, 0.5, even(cloud, uniform), 40)
    assert demand.draws(cloud, uniform) == demand.draws(cloud, uniform)


def test_even_draws_ask_for_what_independent_draws_ask_for() -> None:
    """Within 10 % of the mean of Fox's loop with independent draws; even ones touch a few bins sooner."""
    cloud = spread_cloud(1, 20_000, 2.0)
    rng = np.random.default_rng(2)
    share = cloud.weights / cloud.weights.sum(dtype=np.float64)
    independent = [fox(cloud, 0.5, iter(rng.choice(20_000, 20_000, p=share).tolist()), 40) for _ in range(20)]
    ours = [Demand(0.5, 10.0, error=0.05, minimum=40).draws(cloud, u) for u in np.linspace(0.05, 1.0, 20)]
    assert float(np.mean(ours)) == pytest.approx(float(np.mean(independent)), rel=0.1)


def test_systematic_resampling_to_the_draws_keeps_the_bound() -> None:
    """Count bins first, then resample by Table 4.4: what is left is as many as its own bins ask for, within 5 %."""
    for seed in range(5):
        cloud = spread_cloud(seed, 30_000, 1.5)
        demand = Demand(0.5, 10.0, error=0.05, minimum=40)
        count = demand.draws(cloud, 0.4)
        left = Cloud(cloud.columns[:, systematic(cloud.weights, count, 0.4)])
        assert count == pytest.approx(bound(demand.bins(left), 0.05, 0.99), rel=0.05)


@pytest.mark.interpreted
def test_draws_from_one_bin_are_the_minimum() -> None:
    one_heavy = np.where(np.arange(5000) == 77, 1.0, 1e-30)
    scattered = np.random.default_rng(3).uniform(0, 1000, (3, 5000))
    assert Demand(0.5, 0.5, minimum=70).draws(Cloud(scattered, one_heavy), 0.3) == 70
    assert Demand(0.5, 0.5, minimum=70).draws(Cloud(np.zeros((3, 5000))), 0.3) == 70
    assert Demand(0.5, 0.5, minimum=70, maximum=900).draws(Cloud(scattered), 0.3) == 900


def test_draws_need_weights_and_a_number() -> None:
    for uniform in (0.0, 1.5, math.nan):
        with pytest.raises(ValueError, match="uniform"):
            Demand(0.5, 0.5).draws(Cloud(np.zeros((3, 5))), uniform)
    for weights in (np.zeros(5), np.full(5, math.nan)):
        with pytest.raises(ValueError, match="sum"):
            Demand(0.5, 0.5).draws(Cloud(np.zeros((3, 5)), weights), 0.5)


@pytest.mark.interpreted
def test_stamps_start_anew_before_they_overflow() -> None:
    cloud, demand = spread_cloud(4, 500, 2.0), Demand(0.5, 10.0, minimum=40)
    first = demand.draws(cloud, 0.2)
    demand._draw_stamp = 0x7FFFFFFF  # as after two thousand million calls
    assert demand.draws(cloud, 0.2) == first
