"""The kernel density against scipy's, and with angles against the sum over turns."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from filters.density.kernel import Kernels, scott, silverman


@pytest.mark.parametrize(("rule", "name"), [(scott, "scott"), (silverman, "silverman")])
def test_it_equals_scipy_in_one_dimension(rule: object, name: str) -> None:
    """scipy's covariance of weighted data is divided by 1 - Σ w²: the bandwidth is given to it accordingly."""
    rng = np.random.default_rng(1)
    points, weights = rng.normal(2.0, 3.0, 400), rng.random(400)
    density = Kernels(rule=rule)(points[:, None], weights)  # type: ignore[arg-type]
    share = weights / weights.sum()
    other = stats.gaussian_kde(points, name, weights)
    other.set_bandwidth(other.factor * math.sqrt(1.0 - float(share @ share)))
    x = np.linspace(-10.0, 12.0, 101)
    np.testing.assert_allclose(density.evaluate(x[:, None]), other(x), rtol=1e-10)


def test_it_equals_a_sum_of_scipys_normals() -> None:
    rng = np.random.default_rng(2)
    points, weights = rng.normal(size=(50, 3)), rng.random(50)
    density = Kernels(bandwidth=[0.5, 0.2, 1.0])(points, weights)
    x = rng.normal(size=(20, 3))
    expected = sum(
        w * stats.multivariate_normal(p, np.diag([0.25, 0.04, 1.0])).pdf(x)
        for w, p in zip(weights / weights.sum(), points, strict=True)
    )
    np.testing.assert_allclose(density.evaluate(x), expected, rtol=1e-10)


@pytest.mark.parametrize("width", [0.1, 1.0, 3.0])
def test_on_the_circle_it_is_wound(width: float) -> None:
    points = np.array([[3.0], [-1.0]])
    x = np.linspace(-3.1, 3.1, 40)[:, None]
    expected = sum(
        0.5 * stats.norm.pdf(x[:, 0] + 2.0 * math.pi * k, p, width) for k in range(-8, 9) for p in (3.0, -1.0)
    )
    found = Kernels(bandwidth=[width])(points, None, [True]).evaluate(x)
    np.testing.assert_allclose(found, expected, rtol=1e-10)


def test_moments_are_the_particles_and_the_kernels() -> None:
    points = np.random.default_rng(3).normal(size=(300, 2))
    mean, covariance = Kernels(bandwidth=[0.5, 2.0])(points).moments()
    np.testing.assert_allclose(mean, points.mean(axis=0), atol=1e-13)
    np.testing.assert_allclose(covariance, np.cov(points.T, ddof=0) + np.diag([0.25, 4.0]), rtol=1e-12)


def test_no_points_are_no_densities() -> None:
    assert Kernels()([[0.0], [1.0]]).evaluate(np.zeros((0, 1))).shape == (0,)


def test_a_bandwidth_that_is_none_is_refused() -> None:
    for bad in ([0.0], [math.inf], [1.0, 1.0]):
        with pytest.raises(ValueError, match="bandwidths"):
            Kernels(bandwidth=bad)([[0.0], [1.0]])
    with pytest.raises(ValueError, match="no spread"):
        Kernels()([[0.0, 1.0], [1.0, 1.0]])
