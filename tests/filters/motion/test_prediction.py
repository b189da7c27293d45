"""What is added to a belief's moments on the way from the horizon to now, against simulated paths."""

from __future__ import annotations

import math

import numpy as np
import pytest

from filters.motion.prediction import IntervalNoise, process_covariance, velocity_moments

PATHS = 40_000
STEPS = 50


def paths(distance: float, noise: IntervalNoise) -> np.ndarray:
    """Simulate offsets along and across a straight path, and of the heading: (3, PATHS)."""
    rng = np.random.default_rng(7)
    heading = np.zeros(PATHS)
    across = np.zeros(PATHS)
    for _ in range(STEPS):
        before = heading
        heading = heading + rng.normal(0.0, math.sqrt(noise.heading / STEPS), PATHS)
        across += 0.5 * (before + heading) * distance / STEPS
    return np.stack([rng.normal(0.0, math.sqrt(noise.along), PATHS), across, heading])


@pytest.mark.parametrize("course", [0.0, 0.8, -2.5])
def test_the_noise_of_an_interval_is_that_of_simulated_paths(course: float) -> None:
    """Every entry within 5 standard errors (nine entries, three courses: false alarm 2e-5); no tuning."""
    noise = IntervalNoise(0.04, 0.01)
    local = paths(3.0, noise)
    c, s = math.cos(course), math.sin(course)
    simulated = np.cov(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ local)
    expected = process_covariance(3.0, course, noise)
    diagonal = np.diag(expected)
    error = np.sqrt((np.outer(diagonal, diagonal) + expected**2) / PATHS)
    assert (np.abs(simulated - expected) < 5.0 * error + 1e-3 * np.sqrt(np.outer(diagonal, diagonal))).all()


def test_no_noise_adds_nothing() -> None:
    assert not process_covariance(5.0, 1.0, IntervalNoise(0.0, 0.0)).any()


@pytest.mark.parametrize("sigma", [0.05, 0.7, 3.0])
def test_velocity_moments_are_integrals_over_speed_and_heading(sigma: float) -> None:
    """Gauss-Hermite quadrature over the heading; the speed enters by its first two moments only."""
    speed, variance, course = 1.7, 0.09, 0.6
    nodes, weights = np.polynomial.hermite_e.hermegauss(80)
    weights = weights / weights.sum()
    angle = course + sigma * nodes
    cosine, sine = np.cos(angle), np.sin(angle)
    square = speed**2 + variance
    found = velocity_moments(speed, variance, course, sigma**2)
    north, east = speed * weights @ cosine, speed * weights @ sine
    expected = (
        north,
        east,
        square * (weights @ cosine**2) - north**2,
        square * (weights @ (cosine * sine)) - north * east,
        square * (weights @ sine**2) - east**2,
    )
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


def test_an_unknown_heading_has_no_mean_velocity() -> None:
    found = velocity_moments(2.0, 0.0, 1.0, 100.0)
    np.testing.assert_allclose(found, (0.0, 0.0, 2.0, 0.0, 2.0), atol=1e-12)
