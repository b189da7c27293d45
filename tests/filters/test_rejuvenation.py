"""Tempering and local kernels by themselves; what a filter does with them is in test_particle.py."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from filters.regularization import silverman
from filters.rejuvenation import LEAF, power, spread

Pose = NDArray[np.float32]


def effective(logs: NDArray[np.float64]) -> float:
    weights = np.exp(logs - logs.max())
    return float(weights.sum() ** 2 / np.square(weights).sum())


def drawn(pose: Pose, seed: int = 1, radians: float = 0.4) -> NDArray[np.float64]:
    normals = np.random.default_rng(seed).standard_normal(pose.shape).astype(np.float32)
    return spread(pose, normals, radians)


def test_the_power_of_a_normal_likelihood() -> None:
    """Points uniform in [-1, 1] under exp(-x² / 2 s²): sqrt(pi) s of them count; a power p makes s / sqrt(p)."""
    points, sigma, share = np.linspace(-1.0, 1.0, 20_001), 0.01, 0.2
    logs = (-0.5 * (points / sigma) ** 2).astype(np.float32)
    assert power(logs, share) == pytest.approx((math.sqrt(math.pi) * sigma / share) ** 2, rel=0.05)


@given(st.integers(0, 2**32 - 1), st.floats(0.01, 0.9), st.floats(0.1, 300.0))
def test_enough_stay_effective_and_no_more_is_lost_than_must_be(
    seed: int, share: float, spread_of: float
) -> None:
    logs = (spread_of * np.random.default_rng(seed).standard_normal(400)).astype(np.float32)
    found, wide = power(logs, share), logs.astype(np.float64)
    if effective(wide) >= 1.001 * share * 400:
        assert found == 1.0
    elif found > 0.002:
        assert effective(found * wide) >= 0.999 * share * 400
        assert effective(1.003 * found * wide) < 1.001 * share * 400


def test_weights_of_zero_stay_zero() -> None:
    """Where fewer particles than wanted have weight at all, the least power is all that can be done."""
    logs = np.array([0.0, -3.0, -np.inf, np.nan, -1e30], np.float32)
    assert 0.0 < power(logs, 0.8) < 0.01
    assert power(np.full(5, -np.inf, np.float32), 0.5) == 1.0
    assert power(np.full(5, np.nan, np.float32), 0.5) == 1.0


@pytest.mark.parametrize("share", [0.0, 1.1, math.nan])
def test_no_share_of_nothing(share: float) -> None:
    with pytest.raises(ValueError, match="share"):
        power(np.zeros(3, np.float32), share)


def test_copies_come_apart_and_the_whole_hardly_widens() -> None:
    """4,000 copies of 1,000 values, the heavier nine times as often; within 5 standard errors of 1,000."""
    rng = np.random.default_rng(2)
    root = np.array([[2.0, 0.0, 0.0], [1.0, 0.5, 0.0], [0.0, 0.1, 0.5]])
    values = (root @ rng.standard_normal((3, 1000)) + [[30.0], [-8.0], [0.0]]).astype(np.float32)
    pose = values[:, rng.choice(1000, 4000, p=np.repeat([0.0002, 0.0018], 500))]
    after = drawn(pose)
    assert np.unique(after[0]).size == 4000
    deviation = pose.std(axis=1)
    np.testing.assert_array_less(
        np.abs(after.mean(axis=1) - pose.mean(axis=1)), 5.0 * deviation / math.sqrt(1000)
    )
    widened = after.var(axis=1) / pose.var(axis=1)
    assert np.all((widened > 1.0) & (widened < 1.2))


def test_a_dimension_along_which_nothing_is_halved_widens_by_the_bandwidth() -> None:
    """Headings that all neighbours share: variance 1 + h², h Silverman's for a leaf; within 5 standard errors."""
    rng = np.random.default_rng(7)
    leaf = 1024 // 2 ** math.floor(math.log2(1024 / LEAF))
    ratios: list[float] = []
    for seed in range(10):
        pose = np.stack([*rng.uniform(-50, 50, (2, 1024)), rng.normal(0.0, 0.1, 1024)]).astype(np.float32)
        ratios.append(float(drawn(pose, seed)[2].var() / pose[2].var()))
    expected = 1.0 + silverman(leaf, 3) ** 2 * (1.0 - 1.0 / leaf)
    assert np.mean(ratios) == pytest.approx(expected, abs=5.0 * math.sqrt(4.0 / 10240))


def test_a_ring_stays_a_ring_and_two_places_two() -> None:
    rng = np.random.default_rng(3)
    angle = rng.uniform(-math.pi, math.pi, 2000)
    ring = 20.0 + 0.3 * rng.standard_normal(2000)
    pose = np.stack([ring * np.cos(angle), ring * np.sin(angle), rng.normal(0.0, 0.1, 2000)])
    away = np.hypot(*drawn(pose[:, rng.integers(0, 2000, 6000)].astype(np.float32))[:2]) - 20.0
    assert np.std(away) < 0.6
    places = np.where(rng.random(2000) < 0.4, 0.0, 14.0) + rng.normal(0.0, 0.2, 2000)
    pose = np.stack([rng.normal(0.0, 0.2, 2000), places, rng.normal(0.0, 0.1, 2000)])
    east = drawn(pose[:, rng.integers(0, 2000, 6000)].astype(np.float32))[1]
    between = (east > 1.5) & (east < 12.5)
    assert between.mean() < 3 * LEAF / 2000  # one neighbourhood may reach from one to the other


def test_headings_across_the_seam_of_the_circle() -> None:
    rng = np.random.default_rng(4)
    turned = rng.normal(math.pi, 0.1, 600)
    pose = np.stack([rng.normal(0, 5, 600), rng.normal(0, 5, 600), (turned + math.pi) % math.tau - math.pi])
    after = drawn(pose[:, rng.integers(0, 600, 3000)].astype(np.float32))[2]
    assert -math.pi <= after.min()
    assert after.max() < math.pi
    off = np.remainder(after, math.tau) - math.pi
    assert 0.1 < float(off.std()) < 0.14


@pytest.mark.parametrize("different", [1, 2, 5, 31, 32, 33, 1000])
def test_few_values(different: int) -> None:
    """One value is left where it is, for there is nothing to say how wide it should be."""
    rng = np.random.default_rng(5)
    values = rng.standard_normal((3, different)).astype(np.float32)
    pose = values[:, np.arange(200) % different] if different < 200 else values
    after = drawn(pose)
    assert np.isfinite(after).all()
    if different == 1:
        np.testing.assert_allclose(after, pose, rtol=1e-6)
    elif different < 2 * LEAF:
        bandwidth = silverman(different, 3)
        assert np.unique(after[0]).size == 200
        assert np.abs(after - after.mean()).max() < 6.0 * (1.0 + bandwidth)


def test_a_value_that_is_not_finite_harms_its_neighbours_only() -> None:
    pose = np.random.default_rng(6).standard_normal((3, 1000)).astype(np.float32)
    pose[1, 7] = np.nan
    assert np.isfinite(drawn(pose)).all(axis=0).sum() >= 1000 - 2 * LEAF
