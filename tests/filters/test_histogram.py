"""The histogram filter against the Kalman filter, brute force, and scipy."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from scipy import stats

from filters.cells import CellIntegral, CellMean
from filters.grid import Axis, Grid, circle
from filters.histogram import HistogramFilter
from filters.kalman import KalmanFilter

Columns = Sequence[np.ndarray]
GRID = Grid([Axis(-5.0, 5.0, 20), Axis(-5.0, 5.0, 20), circle(8)])
SIGMA = [0.3, 0.3, 0.2]


def ring(states: Columns) -> np.ndarray:
    return -0.5 * ((np.hypot(states[0] - 1.0, states[1]) - 2.0) / 0.5) ** 2


def forward(states: Columns) -> list[np.ndarray]:
    return [states[0] + 0.8 * np.cos(states[2]), states[1] + 0.8 * np.sin(states[2]), states[2] + 0.3]


def line(cells: int, rule: CellMean | CellIntegral) -> HistogramFilter:
    return HistogramFilter(Grid([Axis(-12.0, 12.0, cells)]), rule)


def against_kalman(cells: int, rule: CellMean | CellIntegral) -> tuple[float, float, float]:
    """Errors of mean, variance and log evidence after ten steps of a linear system."""
    belief = line(cells, rule)
    belief.initialize(lambda s: -0.5 * (s[0] + 3.0) ** 2)
    exact = KalmanFilter([-3.0], [[1.0]])
    evidence = 0.0
    for z in np.random.default_rng(1).normal(size=10):
        belief.predict(lambda s: [0.9 * s[0] + 0.5], [0.7])
        exact.predict([[0.9]], [[0.49]], [[1.0]], [0.5])
        evidence += belief.update(
            lambda s, z=z: -0.5 * ((z - s[0]) / 1.3) ** 2 - math.log(1.3 * math.sqrt(2 * math.pi))
        )
        evidence -= exact.correct([z], [[1.0]], [[1.69]]).log_evidence
    moments = belief.moments()
    return (
        abs(moments.mean[0] - exact.mean[0]),
        abs(moments.covariance[0, 0] - exact.covariance[0, 0]),
        abs(evidence),
    )


def test_with_smaller_cells_the_integrals_approach_the_kalman_filter() -> None:
    """The error of a piecewise constant belief is of second order: half the width, a quarter of the error."""
    errors = np.array([against_kalman(cells, CellIntegral(3)) for cells in (48, 96, 192, 384)])
    ratio = errors[:-1] / errors[1:]
    assert ((ratio > 3.3) & (ratio < 4.8)).all()
    assert errors[-1].max() < 2e-3


def test_by_cell_means_the_kalman_filter_is_met_closely() -> None:
    """Sampled at a third of the noise, smooth densities make the lattice sum all but exact (Poisson)."""
    mean, variance, evidence = against_kalman(192, CellMean())
    assert mean < 1e-9
    assert variance == pytest.approx(
        0.125**2 / 12.0, abs=1e-9
    )  # the cells' own, which no finer sampling removes
    assert evidence < 1e-9


def test_an_update_is_bayes_rule_cell_by_cell() -> None:
    belief = HistogramFilter(GRID)
    prior = np.random.default_rng(2).dirichlet(np.ones(GRID.size)).reshape(GRID.shape)
    belief.reset(3.0 * prior)
    evidence = belief.update(ring)
    weighed = prior * np.exp(np.broadcast_to(ring(GRID.states()), GRID.shape))
    np.testing.assert_allclose(belief.belief, weighed / weighed.sum(), atol=1e-15)
    assert evidence == pytest.approx(math.log(weighed.sum()), abs=1e-12)
    assert belief.touched == GRID.size


def test_what_was_impossible_by_300_orders_can_come_back() -> None:
    belief = line(4, CellMean())
    belief.update(lambda s: np.array([0.0, -600.0, -700.0, -math.inf]))
    evidence = belief.update(lambda s: np.array([-2000.0, -200.0, 0.0, 5.0]))
    assert belief.belief.argmax() == 2
    assert evidence == pytest.approx(-700.0, abs=1e-3)


def test_a_measurement_that_no_cell_explains_changes_nothing() -> None:
    for share in (0.0, 0.5):
        belief = HistogramFilter(Grid([Axis(0.0, 4.0, 4)]), share=share)
        belief.reset([1.0, 2.0, 3.0, 0.0])
        assert belief.update(lambda s: np.full(s[0].shape, -math.inf)) == -math.inf
        assert belief.update(lambda s: np.where(s[0] > 3.0, 0.0, -math.inf)) == -math.inf
        np.testing.assert_allclose(belief.belief, np.array([1.0, 2.0, 3.0, 0.0]) / 6.0)


@pytest.mark.interpreted
def test_what_leaves_the_grid_is_counted() -> None:
    belief = HistogramFilter(Grid([Axis(0.0, 4.0, 4)]))
    assert belief.predict(lambda s: [s[0] + 1.0], [0.0]) == pytest.approx(0.25)
    assert belief.belief.tolist() == pytest.approx([0.0, 1 / 3, 1 / 3, 1 / 3])
    assert belief.predict(lambda s: [s[0] + 1.0], [0.0]) == pytest.approx(1 / 3)
    assert belief.departed == pytest.approx(0.5)
    before = belief.belief.copy()
    assert belief.predict(lambda s: [s[0] + 100.0], [0.0]) == 1.0
    np.testing.assert_array_equal(belief.belief, before)
    belief.reset(np.ones(4))
    assert belief.departed == 0.0


# --- selective updating ---------------------------------------------------------------------------------------------


def drive(share: float) -> tuple[HistogramFilter, int]:
    belief, touched = HistogramFilter(GRID, share=share), 0
    for _ in range(6):
        belief.update(ring)
        touched += belief.touched
        belief.predict(forward, SIGMA)
        touched += belief.touched
    return belief, touched


def test_a_smaller_share_costs_more_and_errs_less() -> None:
    exact, everything = drive(0.0)
    errors, costs = [], []
    for share in (0.1, 0.01, 1e-3, 1e-5):
        belief, touched = drive(share)
        errors.append(0.5 * np.abs(belief.belief - exact.belief).sum())
        costs.append(touched)
        assert belief.belief.sum() == pytest.approx(1.0, abs=1e-12)
    assert errors == sorted(errors, reverse=True)
    assert costs == sorted(costs)
    assert costs[0] < 0.7 * everything  # half of it is the start, where every cell is as likely
    assert errors[2] < 0.02


@pytest.mark.interpreted
def test_cells_under_the_threshold_keep_their_proportions() -> None:
    """The rest is one region with one likelihood: its mean over the rest, here by looking at all of it."""
    belief = HistogramFilter(Grid([Axis(0.0, 8.0, 8)]), share=0.5)
    start = np.array([10.0, 9.0, 1.0, 2.0, 3.0, 1.0, 1.0, 1.0])
    belief.reset(start)
    logs = np.log([0.2, 0.3, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4])
    evidence = belief.update(lambda s: logs[s[0].astype(int)])
    rest = start[2:]
    likelihood = rest @ np.exp(logs[2:]) / rest.sum()
    expected = start * np.append(np.exp(logs[:2]), np.full(6, likelihood))
    np.testing.assert_allclose(belief.belief, expected / expected.sum(), atol=1e-14)
    assert evidence == pytest.approx(math.log(expected.sum() / start.sum()), abs=1e-12)


@pytest.mark.interpreted
def test_a_belief_that_was_wrong_finds_back() -> None:
    """A thousandfold certain of the wrong place, with cells elsewhere not weighed one by one."""
    belief = HistogramFilter(Grid([Axis(0.0, 100.0, 100)]), share=1e-2)
    belief.initialize(lambda s: np.where(np.abs(s[0] - 20.0) < 3.0, 0.0, math.log(1e-5)))
    for _ in range(20):
        belief.update(lambda s: np.logaddexp(-0.5 * ((s[0] - 80.0) / 2.0) ** 2, math.log(0.05)))
    assert abs(belief.most_likely[0] - 80.0) <= 0.5
    assert belief.marginal([0])[75:85].sum() > 0.9


def test_a_selective_filter_falls_back_to_all_cells_when_none_of_its_own_can_be() -> None:
    belief = HistogramFilter(Grid([Axis(0.0, 4.0, 4)]), share=0.5)
    belief.reset([1.0, 1.0, 1e-200, 1e-230])
    belief.update(lambda s: np.where(s[0] < 2.0, -900.0, 0.0))
    assert belief.belief.argmax() == 2
    assert belief.touched == 4


# --- what it says ---------------------------------------------------------------------------------------------------


def test_moments_equal_those_of_the_distribution() -> None:
    grid = Grid([Axis(-8.0, 12.0, 400), circle(360)])
    belief = HistogramFilter(grid)
    belief.initialize(lambda s: -0.5 * ((s[0] - 2.0) / 1.5) ** 2 + 4.0 * np.cos(s[1] - 3.1))
    moments = belief.moments()
    assert moments.mean == pytest.approx([2.0, 3.1], abs=1e-9)
    assert moments.covariance[0, 0] == pytest.approx(2.25 + 0.05**2 / 12.0, abs=1e-7)
    angle = np.linspace(-math.pi, math.pi, 20_001)
    density = stats.vonmises.pdf(angle, 4.0)
    variance = (angle**2 @ density) / density.sum()
    assert moments.covariance[1, 1] == pytest.approx(variance + math.radians(1.0) ** 2 / 12.0, abs=1e-6)
    assert abs(moments.covariance[0, 1]) < 1e-9


def test_density_integrates_to_one_and_is_zero_outside() -> None:
    belief, _ = drive(0.0)
    states = np.column_stack(GRID.states_at(np.arange(GRID.size)))
    assert belief.evaluate(states).sum() * GRID.volume == pytest.approx(1.0, abs=1e-12)
    assert belief.evaluate([[6.0, 0.0, 0.0], [0.0, -5.1, 9.0]]).tolist() == [0.0, 0.0]
    turned = np.add(states, [0.0, 0.0, 4.0 * math.pi])
    np.testing.assert_array_equal(belief.evaluate(turned), belief.evaluate(states))


def test_draws_are_distributed_as_the_belief() -> None:
    """Chi-square over the cells that expect five draws at least; false alarm 1e-6."""
    belief, _ = drive(0.0)
    drawn = belief.draw(200_000, np.random.default_rng(4))
    counts = np.bincount(GRID.cell_of(drawn), minlength=GRID.size)
    expected = belief.belief.reshape(-1) * len(drawn)
    many = expected >= 5.0
    statistic = ((counts - expected)[many] ** 2 / expected[many]).sum()
    assert statistic < stats.chi2.isf(1e-6, many.sum())
    within = (drawn[:, 0] + 5.0) / 0.5 % 1.0
    assert stats.kstest(within, "uniform").pvalue > 1e-6
    assert belief.draw(0, np.random.default_rng(1)).shape == (0, 3)


def test_marginals_and_the_likeliest_cell() -> None:
    belief, _ = drive(0.0)
    np.testing.assert_allclose(belief.marginal([1]), belief.belief.sum(axis=(0, 2)))
    np.testing.assert_allclose(belief.marginal([2, 0]), belief.belief.sum(axis=1))
    place = np.unravel_index(belief.belief.argmax(), GRID.shape)
    assert belief.most_likely.tolist() == [axis.centres[k] for axis, k in zip(GRID.axes, place, strict=True)]


def test_the_belief_cannot_be_written_to() -> None:
    with pytest.raises(ValueError, match="read-only"):
        HistogramFilter(GRID).belief[0, 0, 0] = 1.0


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda b: b.reset(np.ones(3)), "probabilities needed"),
        (lambda b: b.reset(-np.ones(GRID.shape)), "not negative"),
        (lambda b: b.reset(np.full(GRID.shape, math.nan)), "finite"),
        (lambda b: b.reset(np.zeros(GRID.shape)), "not all zero"),
        (lambda b: b.initialize(lambda s: np.full((1, 1, 1), -math.inf)), "zero in every cell"),
        (lambda b: b.update(lambda s: s[0] * math.nan), "below infinity"),
        (lambda b: b.predict(lambda s: [x * math.nan for x in s], SIGMA), "finite"),
        (lambda b: b.draw(-1, np.random.default_rng(1)), "count"),
        (lambda b: b.marginal([3]), "axes"),
        (lambda b: b.evaluate([[math.nan, 0.0, 0.0]]), "finite"),
    ],
)
def test_bad_input_is_refused_and_harms_nothing(spoil: object, message: str) -> None:
    belief, _ = drive(0.01)
    before = belief.belief.copy()
    with pytest.raises(ValueError, match=message):
        spoil(belief)
    np.testing.assert_array_equal(belief.belief, before)


@pytest.mark.parametrize("share", [-0.1, 1.0, math.nan])
def test_a_share_out_of_range_is_refused(share: float) -> None:
    with pytest.raises(ValueError, match="share"):
        HistogramFilter(GRID, share=share)
