"""The sums over weights against float64 numpy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import special

from filters.kernels import weights


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
def test_exponentiate(count: int) -> None:
    logs = some(count)
    before = logs.astype(np.float64)
    out = np.full(count, 7.0, np.float32)
    sums = np.zeros(2)
    middle = count // 3
    top = float(logs.max())
    weights.exponentiate(logs, out, 0, middle, top, sums)
    weights.exponentiate(logs, out, middle, count, top, sums)
    exact = np.exp(before - top)
    np.testing.assert_allclose(out, exact, rtol=2e-5, atol=2e-38)
    np.testing.assert_allclose(sums, [exact.sum(), (exact**2).sum()], rtol=1e-5)
    np.testing.assert_allclose(logs, before - top, atol=1e-5)


@pytest.mark.parametrize(("count", "stride"), [(1, 1), (100, 1), (5000, 3), (5000, 7)])
def test_log_sum(count: int, stride: int) -> None:
    logs = some(count)
    sample = np.zeros(count // stride, np.float32)
    exact = special.logsumexp(logs[: sample.size * stride : stride].astype(np.float64))
    assert weights.log_sum(logs, stride, sample) == pytest.approx(exact, abs=2e-5)


def test_log_sum_of_nothing() -> None:
    assert weights.log_sum(np.full(9, -np.inf, np.float32), 1, np.zeros(9, np.float32)) == -math.inf


def test_moments_of_displaced_particles() -> None:
    rng = np.random.default_rng(5)
    count = 3000
    columns = np.stack(
        [rng.normal(100, 3, count), rng.normal(-50, 2, count), rng.uniform(-np.pi, np.pi, count)]
    ).astype(np.float32)
    w = rng.exponential(size=count).astype(np.float32)
    forward, right, turn, north, east, heading = 1.5, -0.5, 0.7, 99.0, -49.0, 0.3
    sums = np.zeros(weights.SUMS)
    weights.moments(columns, w, 0, 1000, forward, right, turn, north, east, heading, sums)
    weights.moments(columns, w, 1000, count, forward, right, turn, north, east, heading, sums)
    a, b, c = columns.astype(np.float64)
    n = a + forward * np.cos(c) - right * np.sin(c) - north
    e = b + forward * np.sin(c) + right * np.cos(c) - east
    h = (c + turn - heading + np.pi) % (2 * np.pi) - np.pi
    terms = (np.ones(count), n, e, h, np.sin(h), np.cos(h), n * n, n * e, e * e, n * h, e * h, h * h)
    exact = np.array([np.sum(w.astype(float) * term) for term in terms])
    scale = np.array([np.sum(w.astype(float) * np.abs(term)) for term in terms])
    assert (np.abs(sums[:12] - exact) < 1e-5 * scale).all()
    assert sums[12] == pytest.approx(np.abs(h).max(), abs=1e-5)


def test_spread() -> None:
    rng = np.random.default_rng(6)
    columns = rng.normal(0, 1, (5, 700)).astype(np.float32)
    w = rng.exponential(size=700).astype(np.float32)
    references = np.arange(5, dtype=np.float32)[:, None]
    sums = np.zeros(weights.SUMS + 4)
    weights.spread(columns, w, 0, 100, references, sums)
    weights.spread(columns, w, 100, 700, references, sums)
    offsets = columns.astype(float) - references
    np.testing.assert_allclose(sums[-4::2], (w * offsets).sum(1)[3:], rtol=1e-5)
    np.testing.assert_allclose(sums[-3::2], (w * offsets**2).sum(1)[3:], rtol=1e-5)
    assert (sums[: weights.SUMS] == 0.0).all()
