"""Radius and ellipse of a Gaussian against integrals and quantiles of scipy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import integrate, special, stats

from filters.density.gaussian import inside, mahalanobis_square, probability_within, radius


def exact_probability(r: float, ratio: float) -> float:
    """Probability of the circle of radius r for standard deviations 1 and ratio, as an integral."""
    if ratio == 0.0:
        return float(2.0 * stats.norm.cdf(r) - 1.0)
    return float(
        integrate.quad(
            lambda t: (
                stats.norm.pdf(r * math.sin(t))
                * special.erf(r * math.cos(t) / ratio / math.sqrt(2.0))
                * r
                * math.cos(t)
            ),
            -math.pi / 2,
            math.pi / 2,
            limit=500,
            epsabs=1e-11,
        )[0]
    )


@pytest.mark.parametrize("ratio", [0.0, 0.003, 0.05, 0.1234, 0.5, 0.777, 1.0])
@pytest.mark.parametrize("probability", [0.5, 0.95, 0.99])
def test_the_circle_holds_what_it_says(probability: float, ratio: float) -> None:
    turn = np.array([[math.cos(0.7), -math.sin(0.7)], [math.sin(0.7), math.cos(0.7)]])
    covariance = turn @ np.diag([9.0, 9.0 * ratio**2]) @ turn.T
    r = radius(covariance, probability) / 3.0
    assert exact_probability(r, ratio) == pytest.approx(probability, abs=2e-5)


def test_known_radii() -> None:
    assert radius(np.eye(2), 0.95) == pytest.approx(math.sqrt(stats.chi2.ppf(0.95, 2)), abs=1e-5)
    assert radius(np.diag([0.0, 4.0]), 0.95) == pytest.approx(2 * 1.959964, abs=1e-4)
    assert radius(np.zeros((2, 2)), 0.95) == 0.0


def test_probability_within_is_that_of_rayleigh() -> None:
    r = np.linspace(0.0, 4.0, 9)
    np.testing.assert_allclose(probability_within(r, 1.0, 1.0), stats.rayleigh.cdf(r), atol=1e-12)


def test_the_ellipse_holds_what_it_says() -> None:
    """Of 100,000 draws within 4.9 binomial standard deviations: false alarm 1e-6."""
    covariance = np.array([[4.0, 1.5], [1.5, 1.0]])
    draws = np.random.default_rng(1).multivariate_normal([0.0, 0.0], covariance, 20_000)
    within = sum(inside(draw, covariance, 0.9) for draw in draws)
    assert abs(within - 18_000) < 4.9 * math.sqrt(20_000 * 0.09)


def test_mahalanobis_square() -> None:
    covariance = np.array([[4.0, 1.5, 0.0], [1.5, 1.0, 0.0], [0.0, 0.0, 2.0]])
    difference = np.array([1.0, -2.0, 3.0])
    expected = difference @ np.linalg.inv(covariance) @ difference
    assert mahalanobis_square(difference, covariance) == pytest.approx(expected)


@pytest.mark.parametrize("probability", [0.0, 1.0, math.nan])
def test_a_probability_is_between_zero_and_one(probability: float) -> None:
    with pytest.raises(ValueError, match="probability"):
        radius(np.eye(2), probability)


def test_a_covariance_is_finite() -> None:
    with pytest.raises(ValueError, match="finite"):
        radius(np.full((2, 2), np.nan), 0.9)
