"""Bandwidth and kernel of regularised resampling; what they do to a belief is in test_particle.py."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from filters.kernels.regularization import shrink
from filters.regularization import Preserving, Spreading, root, silverman, weighted_covariance

pytestmark = pytest.mark.interpreted


@pytest.mark.parametrize(("count", "dimension"), [(50, 1), (1000, 2), (777, 5)])
def test_the_bandwidth_is_scipys(count: int, dimension: int) -> None:
    points = np.random.default_rng(1).normal(size=(dimension, count))
    scipys = stats.gaussian_kde(points, "silverman").factor
    assert silverman(count, dimension) == pytest.approx(scipys, rel=1e-12)


def test_shrinkage_makes_up_for_the_spread() -> None:
    for effective in (1.0, 2.0, 100.0, 1e6):
        factor, bandwidth = Preserving().kernel(effective, 3)
        assert factor**2 + bandwidth**2 == pytest.approx(1.0, abs=1e-12)
        assert Spreading().kernel(effective, 3) == (1.0, silverman(effective, 3))
    assert Preserving().kernel(1.0, 1) == (0.0, 1.0)  # wider than the set: a Gaussian in its place


def test_the_root_of_a_singular_covariance() -> None:
    rng = np.random.default_rng(2)
    values = np.outer([1.0, 2.0, 0.0], rng.normal(size=100)).astype(np.float32)
    weights = rng.random(100).astype(np.float32)
    mean, covariance = weighted_covariance(values, weights)
    np.testing.assert_allclose(mean, np.average(values, axis=1, weights=weights), atol=1e-6)
    np.testing.assert_allclose(covariance, np.cov(values, aweights=weights, ddof=0), atol=1e-6)
    np.testing.assert_allclose(root(covariance) @ root(covariance).T, covariance, atol=1e-12)


@pytest.mark.parametrize(("effective", "dimension"), [(0.5, 1), (float("nan"), 1), (10.0, 0)])
def test_no_bandwidth_of_nothing(effective: float, dimension: int) -> None:
    with pytest.raises(ValueError, match="bandwidth"):
        silverman(effective, dimension)


def test_shrinking_is_towards_the_mean_and_within_the_block() -> None:
    columns = np.arange(12, dtype=np.float32).reshape(2, 6)
    before = columns.copy()
    shrink(columns, 1, 2, 5, 4.0, 0.25)
    expected = before.copy()
    expected[1, 2:5] = 4.0 + 0.25 * (before[1, 2:5] - 4.0)
    np.testing.assert_allclose(columns, expected, rtol=1e-6)
