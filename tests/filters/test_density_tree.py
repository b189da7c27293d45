"""The density-tree filter against the Kalman filter, a fine histogram, and sampling."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from scipy import stats

from filters.cells import CellIntegral
from filters.density_tree import DensityTreeFilter, Side
from filters.grid import Axis, Grid
from filters.histogram import HistogramFilter
from filters.kalman import KalmanFilter

Columns = Sequence[np.ndarray]
LINE = [Side(-12.0, 12.0, 1e-3)]
POSE = [
    Side(-20.0, 20.0, 0.2, 10.0),
    Side(-20.0, 20.0, 0.2, 10.0),
    Side(-math.pi, math.pi, 0.05, 0.8, wraps=True),
]


def forward(states: Columns) -> list[np.ndarray]:
    north, east, heading = states
    return [north + 2.0 * np.cos(heading), east + 2.0 * np.sin(heading), heading + 0.5]


def against_kalman(bound: float, seed: int) -> list[float]:
    """Errors of mean, variance and log evidence after six steps of a linear system."""
    belief = DensityTreeFilter([Side(-12.0, 12.0, 1e-3, 0.5)], bound)
    belief.initialize(lambda s: -0.5 * (s[0] + 3.0) ** 2)
    exact, evidence = KalmanFilter([-3.0], [[1.0]]), 0.0
    for z in np.random.default_rng(seed).normal(size=6):
        belief.predict(lambda s: [0.9 * s[0] + 0.5], [0.7])
        exact.predict([[0.9]], [[0.49]], [[1.0]], [0.5])
        constant = -math.log(1.3 * math.sqrt(2.0 * math.pi))
        evidence += belief.update(lambda s, z=z, c=constant: c - 0.5 * ((z - s[0]) / 1.3) ** 2)
        evidence -= exact.correct([z], [[1.0]], [[1.69]]).log_evidence
    moments = belief.tree.moments()
    return [moments.mean[0] - exact.mean[0], moments.covariance[0, 0] - exact.covariance[0, 0], evidence]


def test_with_a_smaller_bound_it_approaches_the_kalman_filter() -> None:
    """Root mean squares over five runs; each of the three errors, at a quarter of the bound, at most 0.4 of it."""
    rough, fine = (
        np.sqrt(np.square([against_kalman(bound, seed) for seed in range(5)]).mean(axis=0))
        for bound in (0.0125, 0.003)
    )
    assert (fine < 0.4 * rough).all()
    assert (fine < [5e-4, 2e-3, 2e-3]).all()


def boxed(low: float, high: float, sigma: float, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Probability that a uniform number in [low, high] plus Gaussian noise lies in each [a, b], by quadrature."""
    x, share = np.polynomial.legendre.leggauss(40)
    x = 0.5 * (low + high) + 0.5 * (high - low) * x
    within = stats.norm.cdf((b[:, None] - x) / sigma) - stats.norm.cdf((a[:, None] - x) / sigma)
    return within @ (0.5 * share)


@pytest.mark.interpreted
def test_a_prediction_is_the_sum_of_the_blurred_boxes() -> None:
    """Leaf by leaf (eq. 4.9), a motion that shifts, shrinks and turns; beyond six sigma nothing is followed."""
    sides = [Side(-3.0, 5.0, 0.1, 4.0), Side(-math.pi, math.pi, 0.1, 2.0, wraps=True)]
    belief = DensityTreeFilter(sides, 0.06)
    belief.initialize(lambda s: -0.5 * ((s[0] - 3.0) / 0.8) ** 2 + 2.0 * np.cos(s[1] - 2.5))
    before = belief.tree.leaf_boxes
    departed = belief.predict(lambda s: [0.7 * s[0] + 1.5, s[1] + 1.0], [0.4, 0.5])
    low, high, mass = belief.tree.leaf_boxes
    expected = np.zeros(len(mass))
    for first, last, share in zip(*before, strict=True):
        along = boxed(0.7 * first[0] + 1.5, 0.7 * last[0] + 1.5, 0.4, low[:, 0], high[:, 0])
        around = sum(
            boxed(first[1] + 1.0 + turn, last[1] + 1.0 + turn, 0.5, low[:, 1], high[:, 1])
            for turn in 2.0 * math.pi * np.arange(-2, 3)
        )
        expected += share * along * around
    assert len(mass) > 15
    assert departed == pytest.approx(1.0 - expected.sum(), abs=1e-7)
    assert departed > 0.01
    np.testing.assert_allclose(mass, expected / expected.sum(), atol=1e-7)


def test_an_update_is_the_integral_over_each_leaf() -> None:
    """Equation 4.6 for a likelihood that is a polynomial, which the rule integrates exactly."""
    belief = DensityTreeFilter([Side(-2.0, 2.0, 0.1), Side(0.0, 3.0, 0.1)], 0.02)
    evidence = belief.update(lambda s: np.log(1.0 + s[0] ** 2 + 0.5 * s[0] * s[1] ** 2 + s[1] ** 3))
    low, high, mass = belief.tree.leaf_boxes

    def integral(power: int, axis: int) -> np.ndarray:
        n = power + 1
        return (high[:, axis] ** n - low[:, axis] ** n) / n

    exact = integral(0, 0) * (integral(0, 1) + integral(3, 1)) + integral(2, 0) * integral(0, 1)
    exact += 0.5 * integral(1, 0) * integral(2, 1)
    np.testing.assert_allclose(mass, exact / exact.sum(), rtol=1e-12)
    assert evidence == pytest.approx(math.log(exact.sum() / 12.0), abs=1e-12)
    assert mass.max() <= 0.02


def test_whole_numbers_are_sides_as_good_as_any() -> None:
    whole, real = (DensityTreeFilter([Side(low, high, 1, 4)], 0.1) for low, high in ((0, 9), (0.0, 9.0)))
    for belief in (whole, real):
        belief.update(lambda s: -0.5 * (s[0] - 2.0) ** 2)
        belief.predict(lambda s: [s[0] + 1], [1])
    for one, other in zip(whole.tree.leaf_boxes, real.tree.leaf_boxes, strict=True):
        np.testing.assert_array_equal(one, other)


def moved(bound: float) -> tuple[np.ndarray, np.ndarray]:
    """Difference of the means from 40,000 particles moved three times, and the excess of the variances."""
    belief = DensityTreeFilter(POSE, bound)
    belief.initialize(lambda s: -0.5 * ((s[0] / 0.8) ** 2 + (s[1] / 0.6) ** 2 + (s[2] / 0.3) ** 2))
    rng = np.random.default_rng(5)
    points = rng.normal(0.0, [0.8, 0.6, 0.3], (40_000, 3))
    for _ in range(3):
        assert belief.predict(forward, [0.3, 0.3, 0.1]) < 1e-3  # coarse leaves reach to the box's edge
        points = np.column_stack(forward(points.T)) + rng.normal(0.0, [0.3, 0.3, 0.1], points.shape)
    moments = belief.tree.moments()
    return moments.mean - points.mean(axis=0), np.diag(moments.covariance) / points.var(axis=0) - 1.0


def test_a_bending_motion_approaches_sampling() -> None:
    """Each step blurs by the leaves' width squared: leaves of an eighth of the mass, a quarter of the excess."""
    _, rough = moved(4e-3)
    mean, fine = moved(5e-4)
    assert np.abs(mean).max() < 0.05
    assert (fine < 0.5 * rough).all()
    assert np.abs(fine).max() < 0.4


def ring(states: Columns) -> np.ndarray:
    return -0.5 * ((np.hypot(states[0] - 1.0, states[1]) - 4.0) / 0.6) ** 2


def side_on(states: Columns) -> np.ndarray:
    return -0.5 * ((np.hypot(states[0] + 6.0, states[1] - 5.0) - 8.0) / 0.6) ** 2


def test_far_fewer_leaves_than_cells_at_equal_error() -> None:
    """Two ranges in a wide field, against a reference of 512² cells: a tenth of the cells, no larger error."""
    field = [Axis(-40.0, 40.0, 512)] * 2
    reference = HistogramFilter(Grid(field), CellIntegral(2))
    reference.update(ring)
    reference.update(side_on)
    states = np.column_stack(reference.grid.states_at(np.arange(reference.grid.size)))
    exact = reference.evaluate(states)

    def error(density: np.ndarray) -> float:
        return float(0.5 * np.abs(density - exact).sum() * reference.grid.volume)

    tree = DensityTreeFilter([Side(-40.0, 40.0, 0.02, 5.0)] * 2, 1.0 / 150.0)
    static = HistogramFilter(Grid([Axis(-40.0, 40.0, 128)] * 2), CellIntegral(2))
    for belief in (tree, static):
        belief.update(ring)
        belief.update(side_on)
    assert error(tree.tree.evaluate(states)) < error(static.evaluate(states))
    assert tree.tree.leaf_count < static.grid.size / 10


def test_leaves_follow_the_belief_and_their_number_stays() -> None:
    belief = DensityTreeFilter([Side(-50.0, 50.0, 0.05), Side(-50.0, 50.0, 0.05)], 0.01)
    belief.initialize(lambda s: -0.5 * ((s[0] + 20.0) ** 2 + s[1] ** 2))
    counts = []
    for _ in range(4):
        belief.predict(lambda s: [s[0] + 10.0, s[1]], [0.1, 0.1])
        counts.append(belief.tree.leaf_count)
        _, _, mass = belief.tree.leaf_boxes
        assert mass.sum() == pytest.approx(1.0, abs=1e-12)
        assert mass.max() <= 0.01
    assert max(counts) < 1.5 * min(counts)
    assert belief.tree.moments().mean == pytest.approx([20.0, 0.0], abs=0.1)


def test_over_the_seam_of_an_angle() -> None:
    belief = DensityTreeFilter([Side(-math.pi, math.pi, 0.01, wraps=True)], 0.01)
    belief.initialize(lambda s: 20.0 * np.cos(s[0] - 3.0))
    before = belief.tree.moments()
    assert belief.predict(lambda s: [s[0] + 0.4], [0.1]) == pytest.approx(0.0, abs=1e-12)
    after = belief.tree.moments()
    assert math.remainder(after.mean[0] - before.mean[0] - 0.4, 2.0 * math.pi) == pytest.approx(0.0, abs=2e-3)
    assert after.covariance[0, 0] == pytest.approx(before.covariance[0, 0] + 0.01, rel=0.03)
    belief.predict(lambda s: s, [10.0])
    assert belief.tree.evaluate([[0.0], [3.0]]) == pytest.approx([0.5 / math.pi] * 2, rel=1e-6)


def test_what_leaves_the_box_is_counted() -> None:
    belief = DensityTreeFilter([Side(0.0, 4.0, 0.01)], 0.1)
    assert belief.predict(lambda s: [s[0] + 1.0], [0.0]) == pytest.approx(0.25)
    assert belief.predict(lambda s: [s[0] + 1.0], [0.0]) == pytest.approx(1.0 / 3.0, abs=1e-6)
    assert belief.departed == pytest.approx(0.5, abs=1e-6)
    assert belief.predict(lambda s: [s[0] + 100.0], [0.0]) == 1.0
    assert belief.tree.moments().mean[0] == pytest.approx(3.0, abs=0.02)


def test_a_motion_that_stretches_stretches_the_leaves() -> None:
    belief = DensityTreeFilter([Side(-16.0, 16.0, 0.01)], 0.002)
    belief.initialize(lambda s: -0.5 * s[0] ** 2)
    belief.predict(lambda s: [3.0 * s[0]], [0.0])
    assert belief.tree.moments().covariance[0, 0] == pytest.approx(9.0, rel=5e-3)


def test_a_measurement_that_no_leaf_explains_changes_nothing() -> None:
    belief = DensityTreeFilter(LINE, 0.1)
    before = belief.tree
    assert belief.update(lambda s: np.full(s[0].shape, -math.inf)) == -math.inf
    assert belief.tree is before


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda b: b.initialize(lambda s: np.full(s[0].shape, -math.inf)), "zero in every leaf"),
        (lambda b: b.initialize(lambda s: np.full(s[0].shape, math.nan)), "below infinity"),
        (lambda b: b.update(lambda s: np.zeros(3)), "one number for each"),
        (lambda b: b.predict(lambda s: [s[0] * math.nan], [0.1]), "finite"),
        (lambda b: b.predict(lambda s: [s[0], s[0]], [0.1]), "1 columns"),
        (lambda b: b.predict(lambda s: [np.zeros((2, 2))], [0.1]), "columns of"),
        (lambda b: b.predict(lambda s: s, [-0.1]), "sigma"),
        (lambda b: b.predict(lambda s: s, [0.1, 0.1]), "sigma"),
    ],
)
def test_bad_input_is_refused_and_harms_nothing(spoil: object, message: str) -> None:
    belief = DensityTreeFilter(LINE, 0.1)
    belief.update(lambda s: -0.5 * s[0] ** 2)
    before = belief.tree
    with pytest.raises(ValueError, match=message):
        spoil(belief)
    assert belief.tree is before


def test_a_bound_out_of_range_is_refused() -> None:
    with pytest.raises(ValueError, match="bound"):
        DensityTreeFilter(LINE, 0.0)
