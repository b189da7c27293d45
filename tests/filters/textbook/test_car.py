"""Exercises 1 and 4 against the sums that the linear system has in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from filters.textbook import car, car_histogram


def test_the_kalman_filter_gives_the_closed_form() -> None:
    """x(t) = Σ (t - s - 1/2) a(s) and v(t) = Σ a(s), the accelerations being independent of variance 1."""
    found = car.kalman()
    for time in range(car.STEPS + 1):
        reach = np.arange(time) + 0.5
        expected = [[np.sum(reach**2), np.sum(reach)], [np.sum(reach), time]]
        np.testing.assert_allclose(found.covariances[time], expected, atol=1e-12)
        np.testing.assert_array_equal(found.means[time], 0.0)


def test_the_measurement_conditions_the_joint_gaussian() -> None:
    """Var x = 41.25, Cov = 12.5, Var v = 5, z = 5, Q = 10."""
    found = car.kalman()
    np.testing.assert_allclose(found.means[-1], [5.0 * 41.25 / 51.25, 5.0 * 12.5 / 51.25], rtol=1e-12)
    covariance = np.array([[41.25, 12.5], [12.5, 5.0]]) - np.outer([41.25, 12.5], [41.25, 12.5]) / 51.25
    np.testing.assert_allclose(found.covariances[-1], covariance, rtol=1e-12)
    assert found.log_evidence == pytest.approx(stats.norm.logpdf(5.0, 0.0, math.sqrt(51.25)), rel=1e-12)


def test_the_histogram_is_the_kalman_filter_but_for_its_cells() -> None:
    """By cell means on a grid that every shift fits: the covariance is larger by a cell's own width²/12."""
    exact, found = car.kalman(), car_histogram.histogram(0.5)
    np.testing.assert_allclose(found.moments.means, exact.means, atol=1e-6)
    own = car_histogram.SHEAR @ (np.eye(2) * 0.5**2 / 12.0) @ car_histogram.SHEAR.T
    np.testing.assert_allclose(found.moments.covariances[2:], exact.covariances[2:] + own, atol=2e-3)
    np.testing.assert_allclose(found.moments.covariances[-1], exact.covariances[-1] + own, atol=1e-5)
    assert found.moments.log_evidence == pytest.approx(exact.log_evidence, abs=2e-6)
    assert found.distance < 5e-3


def test_the_cells_probabilities_are_those_of_sampling() -> None:
    """Against a million draws: each cell within 5 standard errors; false alarm below 1e-4 for 105 cells."""
    exact = car.kalman()
    grid = car_histogram.histogram(4.0).grid
    expected = car_histogram.cell_probabilities(grid, exact.means[-1], exact.covariances[-1])
    count = 1_000_000
    drawn = np.random.default_rng(1).multivariate_normal(exact.means[-1], exact.covariances[-1], count)
    places = grid.cell_of(drawn @ np.linalg.inv(car_histogram.SHEAR).T)
    share = np.bincount(places[places >= 0], minlength=grid.size).reshape(grid.shape) / count
    error = np.sqrt(expected * (1.0 - expected) / count) + 1e-6
    assert (np.abs(share - expected) < 5.0 * error).all()


@pytest.mark.parametrize("rule", list(car_histogram.RULES))
def test_finer_cells_are_better(rule: str) -> None:
    found = car_histogram.accuracy(rule, (4.0, 2.0, 1.0))
    assert (np.diff(found.distances) < 0.0).all()
    assert (np.diff(found.cells) > 0).all()
    assert found.covariance_errors[-1] < 0.1


def test_particles_agree_with_the_kalman_filter() -> None:
    """20,000 particles, effective about 9,600: five standard errors of each moment; false alarm below 1e-4."""
    exact, found = car.kalman(), car.particles(20_000, seed=1)
    for time in range(1, car.STEPS + 2):
        size = found.effective_sample_size if time > car.STEPS else found.count
        deviation = np.sqrt(np.diag(exact.covariances[time]))
        np.testing.assert_array_less(
            np.abs(found.moments.means[time] - exact.means[time]), 5.0 * deviation / math.sqrt(size)
        )
        away = np.abs(found.moments.covariances[time] - exact.covariances[time])
        np.testing.assert_array_less(away, 5.0 * math.sqrt(2.0 / size) * np.outer(deviation, deviation))
    assert found.weights.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(found.clouds[1][:, 0], 0.5 * found.clouds[1][:, 1], rtol=1e-6)


def test_the_particles_error_falls_with_their_root() -> None:
    """A factor of 16 in the count is 4 in the error; of 20 runs each it lies in 2.3 to 7 (chi-square, 1e-4)."""
    found = car.convergence(20, (100, 1_600))
    ratio = found.mean_errors[0] / found.mean_errors[1]
    assert 2.3 < ratio < 7.0
    assert (found.covariance_errors > 0.0).all()
    assert (found.evidence_errors > 0.0).all()
