"""Weighted covariance against numpy's."""

from __future__ import annotations

import numpy as np
import pytest

from filters.kernels.covariance import covariance


@pytest.mark.interpreted
@pytest.mark.parametrize("count", [1, 37, 1024, 3000])
def test_it_is_numpys(count: int) -> None:
    """To 2e-5 of the standard deviations, about a reference three of them away."""
    rng = np.random.default_rng(count)
    columns = np.array(rng.normal(0.0, 1.0, (4, 3000)) * [[1.0], [20.0], [0.1], [3.0]] + 1000.0, np.float32)
    columns[3] += columns[0] * 2.0
    weights = rng.uniform(0.0, 1.0, 3000).astype(np.float32)
    rows = np.array([3, 0, 2], np.int64)
    chosen = columns[rows, :count].astype(np.float64)
    reference = chosen.mean(axis=1) + 3.0
    mean, found = np.empty(3), np.empty((3, 3))
    covariance(columns, weights, count, rows, reference, mean, found)
    share = weights[:count].astype(np.float64)
    np.testing.assert_allclose(mean, np.average(chosen, axis=1, weights=share), rtol=1e-7)
    wanted = np.atleast_2d(np.cov(chosen, aweights=share, bias=True)) if count > 1 else np.zeros((3, 3))
    np.testing.assert_allclose(found, wanted, atol=1e-4)
