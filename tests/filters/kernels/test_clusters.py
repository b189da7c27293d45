"""Assignment and sums against brute force in numpy."""

from __future__ import annotations

import math

import numpy as np
import pytest

from filters.kernels import clusters

pytestmark = pytest.mark.interpreted

COUNT, SIZE, MANY = 700, 3, 4
CIRCULAR = np.array([False, True, False])


def turned(x: np.ndarray) -> np.ndarray:
    out = x.astype(np.float64).copy()
    out[..., 1] = np.remainder(out[..., 1] + math.pi, 2.0 * math.pi) - math.pi
    return out


@pytest.fixture
def particles() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    columns = rng.uniform(-3.1, 3.1, (SIZE, COUNT)).astype(np.float32)
    weights = rng.random(COUNT).astype(np.float32)
    centres = rng.uniform(-3.0, 3.0, (MANY, SIZE)).astype(np.float32)
    factors = np.tril(rng.normal(size=(MANY, SIZE, SIZE))).astype(np.float32)
    factors[0, 2, 0] = 0.0
    return columns, weights, centres, factors


def test_assign(particles: tuple[np.ndarray, ...]) -> None:
    columns, _, centres, factors = particles
    constants = np.array([0.0, 0.5, 0.1, 1.0], np.float32)
    costs, labels = np.zeros(COUNT, np.float32), np.zeros(COUNT, np.int32)
    scratch = np.zeros((SIZE + 2, 64), np.float32)
    clusters.assign(columns, 30, 690, centres, factors, constants, CIRCULAR, scratch, costs, labels)
    away = turned(columns.T[30:690, None, :] - centres[None])
    expected = np.square(np.einsum("kij,nkj->nki", factors.astype(np.float64), away)).sum(axis=2) + constants
    np.testing.assert_allclose(costs[:660], expected.min(axis=1), rtol=1e-4, atol=1e-5)
    chosen = expected[np.arange(660), labels[:660]]
    np.testing.assert_allclose(chosen, expected.min(axis=1), rtol=1e-4, atol=1e-5)


def test_moments(particles: tuple[np.ndarray, ...]) -> None:
    columns, weights, centres, _ = particles
    labels = np.random.default_rng(2).integers(0, MANY, COUNT).astype(np.int32)
    first, second = np.zeros((MANY, 1 + SIZE)), np.zeros((MANY, 1 + 3 * SIZE + 6))
    clusters.first_moments(columns, weights, 100, COUNT, labels, centres, CIRCULAR, first)
    clusters.second_moments(columns, weights, 100, COUNT, labels, centres, CIRCULAR, second, np.zeros(SIZE))
    for k in range(MANY):
        mine = 100 + np.flatnonzero(labels[:600] == k)
        away = turned(columns.T[mine].astype(np.float64) - centres[k].astype(np.float64))
        w = weights[mine].astype(np.float64)
        np.testing.assert_allclose(first[k], [w.sum(), *(w @ away)], rtol=1e-5, atol=1e-4)
        np.testing.assert_allclose(second[k, :4], [w.sum(), *(w @ away)], rtol=1e-11)
        np.testing.assert_allclose(second[k, 5], w @ np.sin(away[:, 1]), atol=1e-4)
        np.testing.assert_allclose(second[k, 8], w @ np.cos(away[:, 1]), atol=1e-4)
        expected = ((away * w[:, None]).T @ away)[np.tril_indices(SIZE)]
        np.testing.assert_allclose(second[k, 10:], expected, rtol=1e-11)


def test_sample_is_spread_evenly(particles: tuple[np.ndarray, ...]) -> None:
    columns, weights, _, _ = particles
    some, light = np.zeros((SIZE, 7), np.float32), np.zeros(7, np.float32)
    clusters.sample(columns, weights, COUNT, some, light)
    np.testing.assert_array_equal(some, columns[:, ::100])
    np.testing.assert_array_equal(light, weights[::100])
