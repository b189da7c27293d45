"""The mixture against scipy, and its moments against the law of total covariance."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from filters.density.mixture import Mixture
from filters.density.normal import Gaussian

ONE = Gaussian([0.0, 1.0], [[1.0, 0.2], [0.2, 0.5]])
OTHER = Gaussian([5.0, -1.0], [[0.3, 0.0], [0.0, 2.0]])


def test_it_equals_scipy() -> None:
    points = np.random.default_rng(1).normal(2.0, 3.0, (100, 2))
    expected = 0.25 * stats.multivariate_normal(ONE.mean, ONE.covariance).pdf(points)
    expected += 0.75 * stats.multivariate_normal(OTHER.mean, OTHER.covariance).pdf(points)
    np.testing.assert_allclose(Mixture([1.0, 3.0], [ONE, OTHER]).evaluate(points), expected, rtol=1e-12)


def test_its_moments_are_of_the_whole() -> None:
    mean, covariance = Mixture([1.0, 3.0], [ONE, OTHER]).moments()
    np.testing.assert_allclose(mean, [3.75, -0.5], atol=1e-14)
    apart = OTHER.mean - ONE.mean
    expected = 0.25 * ONE.covariance + 0.75 * OTHER.covariance + 0.1875 * np.outer(apart, apart)
    np.testing.assert_allclose(covariance, expected, atol=1e-12)


@pytest.mark.parametrize("share", [0.5, 0.7, 0.9])
def test_opposite_headings_have_the_moments_of_the_circle(share: float) -> None:
    """Quadrature over the circle; a heading and its opposite is what a mirrored map leaves."""
    parts = [Gaussian([0.4], [[0.16]], [True]), Gaussian([0.4 - math.pi], [[0.36]], [True])]
    mixture = Mixture([share, 1.0 - share], parts)
    angle = -math.pi + (np.arange(40_000) + 0.5) * 2.0 * math.pi / 40_000
    p = mixture.evaluate(angle[:, None]) / 40_000 * 2.0 * math.pi
    direction = math.atan2(float(p @ np.sin(angle)), float(p @ np.cos(angle)))
    mean, covariance = mixture.moments()
    assert mean[0] == pytest.approx(direction, abs=1e-9)
    away = np.remainder(angle - direction + math.pi, 2.0 * math.pi) - math.pi
    assert covariance[0, 0] == pytest.approx(float(p @ away**2), abs=1e-7)


@pytest.mark.parametrize(
    ("weights", "components"),
    [
        ([1.0], [ONE, OTHER]),
        ([], []),
        ([1.0, -1.0], [ONE, OTHER]),
        ([0.0, 0.0], [ONE, OTHER]),
        ([1.0, 1.0], [ONE, Gaussian([0.0], [[1.0]])]),
        ([1.0, 1.0], [ONE, Gaussian([0.0, 0.0], np.eye(2), [False, True])]),
    ],
)
def test_what_is_no_mixture_is_refused(weights: list[float], components: list[Gaussian]) -> None:
    with pytest.raises(ValueError, match="mixture"):
        Mixture(weights, components)
