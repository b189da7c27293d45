"""What every density promises: it integrates to one, draws from what it says, and knows its own moments.

One weighted particle set of a position and a heading, of two places and across the turn from pi to -pi; every
extractor; the oracle is quadrature of ``evaluate``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest
from scipy import stats

from filters.density import circular as angles
from filters.density.binned import BinnedKernels
from filters.density.histogram import Histograms
from filters.density.k_means import KMeans
from filters.density.kernel import KernelDensity, Kernels
from filters.density.normal import gaussian
from filters.density.protocol import Density, Extractor
from filters.density.tree import Trees
from filters.density_tree import DensityTree

CIRCULAR = (False, True)


class Case(NamedTuple):
    extract: Extractor
    smooth: bool


CASES = {
    "gaussian": Case(gaussian, True),
    "mixture": Case(KMeans(), True),
    "histogram": Case(Histograms(), False),
    "tree": Case(Trees(), False),
    "kernel": Case(Kernels(), True),
    "binned": Case(BinnedKernels(), False),
}


def particles() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(5)
    first = rng.random(900) < 0.6
    x = np.where(first, rng.normal(0.0, 1.0, 900), rng.normal(4.0, 0.7, 900))
    heading = np.where(first, rng.normal(3.0, 0.3, 900), rng.normal(0.6, 0.5, 900))
    return np.column_stack([x, heading]), rng.random(900) + 0.1


class Grid(NamedTuple):
    points: np.ndarray
    values: np.ndarray
    cell: float


@pytest.fixture(scope="module", params=list(CASES))
def case(request: pytest.FixtureRequest) -> tuple[Density, Grid, bool]:
    extract, smooth = CASES[request.param]
    density = extract(*particles(), CIRCULAR)
    many, turn = (13 * 10, 8 * 8) if request.param == "kernel" else (13 * 60, 8 * 30)
    x = -11.0 + (np.arange(many) + 0.5) * 26.0 / many
    heading = -math.pi + (np.arange(turn) + 0.5) * 2.0 * math.pi / turn
    points = np.stack(np.meshgrid(x, heading, indexing="ij"), -1).reshape(-1, 2)
    return density, Grid(points, density.evaluate(points), 52.0 * math.pi / (many * turn)), smooth


def test_the_integral_is_one(case: tuple[Density, Grid, bool]) -> None:
    _, grid, smooth = case
    assert float(grid.values.sum()) * grid.cell == pytest.approx(1.0, abs=1e-8 if smooth else 2e-2)


def test_it_is_nowhere_negative(case: tuple[Density, Grid, bool]) -> None:
    _, grid, _ = case
    assert grid.values.min() >= 0.0


def test_moments_are_those_of_what_it_evaluates(case: tuple[Density, Grid, bool]) -> None:
    density, grid, smooth = case
    share = grid.values / grid.values.sum()
    mean, covariance = density.moments()
    flags = np.array(CIRCULAR)
    expected = angles.mean(grid.points, share, flags)
    away = angles.difference(grid.points, expected, flags)
    second = (away * share[:, None]).T @ away
    tolerance = 2e-4 if smooth else 2e-2
    np.testing.assert_allclose(angles.difference(mean, expected, flags), 0.0, atol=tolerance)
    if isinstance(density, KernelDensity | DensityTree):
        tolerance = 0.06  # kernels and wide leaves that cross the far side are counted as if it went on
    np.testing.assert_allclose(covariance, second, atol=tolerance * second.max())


def test_draws_fall_where_it_is_dense(case: tuple[Density, Grid, bool]) -> None:
    """Chi-square over 13 by 8 boxes, false alarm 1e-6 a density."""
    density, grid, _ = case
    drawn = density.draw(20_000, np.random.default_rng(8))
    edges = [np.linspace(-11.0, 15.0, 14), np.linspace(-math.pi, math.pi, 9)]
    expected = np.histogramdd(grid.points, edges, weights=grid.values)[0].reshape(-1)
    seen = np.histogramdd(drawn, edges)[0].reshape(-1)
    expected *= 20_000 / expected.sum()
    enough = expected > 8.0
    seen = np.append(seen[enough], 20_000 - seen[enough].sum())
    expected = np.append(expected[enough], max(20_000 - expected[enough].sum(), 1.0))
    chi_square = float((np.square(seen - expected) / expected).sum())
    assert chi_square < stats.chi2.ppf(1.0 - 1e-6, len(expected) - 1)
    assert np.abs(drawn[:, 1]).max() <= math.pi


def test_angles_may_be_asked_for_any_turn_away(case: tuple[Density, Grid, bool]) -> None:
    density, grid, smooth = case
    some = grid.points[::371]
    turned = density.evaluate(some + np.array([0.0, 2.0 * math.pi]))
    np.testing.assert_allclose(turned, density.evaluate(some), rtol=1e-6 if smooth else 1e-3, atol=1e-9)


def test_a_common_factor_of_the_weights_changes_nothing() -> None:
    points, weights = (part[:400] for part in particles())
    for extract, _ in CASES.values():
        one, other = extract(points, weights, CIRCULAR), extract(points, 1024.0 * weights, CIRCULAR)
        np.testing.assert_allclose(one.evaluate(points[:50]), other.evaluate(points[:50]), rtol=1e-9)


@pytest.mark.parametrize("name", list(CASES))
@pytest.mark.parametrize(
    ("points", "weights"),
    [
        ([[0.0, math.nan], [1.0, 1.0]], None),
        ([[0.0, 0.0], [1.0, 1.0]], [1.0, -1.0]),
        ([[0.0, 0.0], [1.0, 1.0]], [0.0, 0.0]),
        ([[0.0, 0.0], [1.0, 1.0]], [math.nan, 1.0]),
        ([[0.0, 0.0], [1.0, 1.0]], [1.0]),
        ([0.0, 1.0], None),
        (np.zeros((0, 2)), None),
    ],
)
def test_what_is_no_particle_set_is_refused(name: str, points: object, weights: object) -> None:
    with pytest.raises(ValueError, match=r"points|weights"):
        CASES[name].extract(points, weights, CIRCULAR)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", list(CASES))
def test_points_of_another_dimension_are_refused(name: str) -> None:
    points, weights = particles()
    density = CASES[name].extract(points[:200], weights[:200], CIRCULAR)
    with pytest.raises(ValueError, match="points"):
        density.evaluate([[1.0, 2.0, 3.0]])
    with pytest.raises(ValueError, match=r"finite"):
        density.evaluate([[1.0, math.inf]])
    with pytest.raises(ValueError, match="circular"):
        CASES[name].extract(particles()[0], None, [True])
