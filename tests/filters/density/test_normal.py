"""The extracted Gaussian against scipy's multivariate normal and numpy's weighted covariance."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from filters.density.normal import Gaussian, gaussian, of_moments
from filters.density.protocol import DensityMoments

MEAN = np.array([1.0, -2.0, 0.5])
COVARIANCE = np.array([[2.0, 0.3, -0.1], [0.3, 1.0, 0.2], [-0.1, 0.2, 0.5]])


def test_it_equals_scipy() -> None:
    points = np.random.default_rng(1).normal(size=(200, 3)) * 3.0
    expected = stats.multivariate_normal(MEAN, COVARIANCE).pdf(points)
    np.testing.assert_allclose(Gaussian(MEAN, COVARIANCE).evaluate(points), expected, rtol=1e-12)


@pytest.mark.parametrize("sigma", [0.05, 0.6, 2.0, 6.0])
def test_wound_it_equals_the_sum_over_turns(sigma: float) -> None:
    covariance = np.array([[1.0, 0.4 * sigma], [0.4 * sigma, sigma**2]])
    density = Gaussian([0.5, 3.0], covariance, [False, True])
    points = np.random.default_rng(2).uniform(-3.0, 3.0, (100, 2))
    unwound = stats.multivariate_normal([0.5, 3.0], covariance)
    expected = sum(unwound.pdf(points + np.array([0.0, 2.0 * math.pi * k])) for k in range(-12, 13))
    np.testing.assert_allclose(density.evaluate(points), expected, rtol=1e-10, atol=1e-300)


def test_extraction_equals_numpy() -> None:
    rng = np.random.default_rng(3)
    points, weights = rng.multivariate_normal(MEAN, COVARIANCE, 500), rng.random(500)
    found = gaussian(points, weights)
    np.testing.assert_allclose(found.mean, np.average(points, axis=0, weights=weights), rtol=1e-12)
    expected = np.cov(points.T, aweights=weights, ddof=0)
    np.testing.assert_allclose(found.covariance, expected, rtol=1e-12)
    np.testing.assert_allclose(found.moments().covariance, expected, rtol=1e-12)


@pytest.mark.parametrize("sigma", [0.3, 1.0, 1.6])
def test_its_moments_are_the_particles_however_wide_the_angle(sigma: float) -> None:
    rng = np.random.default_rng(4)
    heading = np.remainder(3.0 + sigma * rng.standard_normal(4000) + math.pi, 2.0 * math.pi) - math.pi
    found = gaussian(heading[:, None], None, [True])
    away = np.remainder(heading - found.mean[0] + math.pi, 2.0 * math.pi) - math.pi
    assert found.moments().covariance[0, 0] == pytest.approx(float(np.mean(away**2)), rel=1e-6)
    # and the sigma before winding is found again: within five standard errors, which winding makes larger
    error = 5.0 * math.exp(sigma**2) / math.sqrt(2.0 * 4000)
    assert math.sqrt(found.covariance[0, 0]) == pytest.approx(sigma, rel=error)


def test_particles_that_are_all_alike_still_make_a_density() -> None:
    found = gaussian([[2.0, 1.0]] * 5, None, [False, True])
    assert found.mean.tolist() == [2.0, 1.0]
    assert np.isfinite(found.evaluate([[2.0, 1.0]])).all()
    flat = of_moments(DensityMoments(np.zeros(2), np.array([[1.0, 1.0], [1.0, 1.0]])), [False, False])
    np.testing.assert_allclose(flat.covariance, 1.0, atol=1e-11)


@pytest.mark.parametrize(
    ("mean", "covariance", "match"),
    [
        ([0.0], np.eye(2), "needed"),
        ([math.nan], [[1.0]], "finite"),
        ([0.0, 0.0], [[1.0, 2.0], [2.0, 1.0]], "positive definite"),
    ],
)
def test_what_is_no_gaussian_is_refused(mean: object, covariance: object, match: str) -> None:
    with pytest.raises(ValueError, match=match):
        Gaussian(mean, covariance)  # type: ignore[arg-type]
