"""The sums over weights against float64 numpy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import special

from filters.kernels import weights

pytestmark = pytest.mark.interpreted


def some(count: int, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).normal(-20.0, 8.0, count).astype(np.float32)


@pytest.mark.parametrize("count", [1, 7, 8, 33, 1000])
def test_peak(count: int) -> None:
    logs = some(count)
    assert weights.peak(logs, 0, count) == logs.max()


def test_peak_of_a_block_of_positive_infinite_and_nan() -> None:
    logs = np.array([9.0, -1.0, 3.0, -np.inf, 50.0], np.float32)
    assert weights.peak(logs, 1, 4) == 3.0
    assert weights.peak(logs, 3, 4) == -np.inf
    logs[2] = np.nan
    assert math.isnan(weights.peak(logs, 0, 5))


@pytest.mark.parametrize("count", [1, 9, 30_000])
def test_normalize(count: int) -> None:
    logs = some(count)
    before = logs.astype(np.float64)
    out = np.full(count, 7.0, np.float32)
    bounds = np.array([0, count // 3, count])
    sums = np.zeros((2, 2))
    top, total, squares = weights.normalize(logs, out, bounds, sums)
    assert top == before.max()
    exact = np.exp(before - top)
    np.testing.assert_allclose(out, exact, rtol=2e-5, atol=2e-38)
    np.testing.assert_allclose([total, squares], [exact.sum(), (exact**2).sum()], rtol=1e-5)
    np.testing.assert_allclose(
        sums[0], [exact[: count // 3].sum(), (exact[: count // 3] ** 2).sum()], rtol=1e-5
    )
    np.testing.assert_allclose(logs, before - top, atol=1e-5)


@pytest.mark.parametrize("level", [-np.inf, -2e30, np.inf, np.nan])
def test_normalizing_nothing_leaves_it(level: float) -> None:
    logs = np.full(5, level, np.float32)
    out = np.full(5, 7.0, np.float32)
    assert weights.normalize(logs, out, np.array([0, 5]), np.zeros((1, 2)))[1:] == (0.0, 0.0)
    assert (out == 7.0).all()
    np.testing.assert_array_equal(logs, np.full(5, level, np.float32))


@pytest.mark.parametrize(("count", "stride"), [(1, 1), (100, 1), (5000, 3), (5000, 7)])
def test_log_sum(count: int, stride: int) -> None:
    logs = some(count)
    taken = count // stride
    sample = np.zeros(taken, np.float32)
    exact = special.logsumexp(logs[: taken * stride : stride].astype(np.float64))
    assert weights.log_sum(logs, taken, stride, sample) == pytest.approx(exact, abs=2e-5)


def test_log_sum_of_nothing() -> None:
    assert weights.log_sum(np.full(9, -np.inf, np.float32), 9, 1, np.zeros(9, np.float32)) == -math.inf
