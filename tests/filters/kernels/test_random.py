"""The random numbers, tested as random numbers.

Every statistic is turned into a standard normal deviate (or a p-value) and compared with a bound that a fair
generator exceeds with the stated probability; the numbers are a function of the seeds written here, so a test
passes always or never. False-alarm rate: below 1e-5 per assertion, 1e-3 for the whole file, had the seeds
been drawn afresh.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from filters.kernels import random

N = 1 << 18
BOUND = 4.9  # of a standard normal deviate, two-sided: 1e-6
SEEDS = (0, 1, 2**63 + 12345)


def draw(seed: int, stream: int, step: int, first: int = 0, count: int = N) -> NDArray[np.float64]:
    """Return the pair of rows of one stream at one step."""
    noise = np.zeros((2, count), np.float32)
    random.normal_pairs(first, first + count, step, random.key(seed, stream), noise, 0)
    return noise.astype(np.float64)


def deviate(values: NDArray[np.float64], mean: float, variance: float) -> float:
    """Standardise the mean of independent values of known mean and variance."""
    return float((values.mean() - mean) / math.sqrt(variance / values.size))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("step", [1, 2, 1_000_000, 2**32 - 1])
def test_moments_to_order_four(seed: int, step: int) -> None:
    for x in draw(seed, 0, step):
        assert abs(deviate(x, 0.0, 1.0)) < BOUND
        assert abs(deviate(x**2, 1.0, 2.0)) < BOUND
        assert abs(deviate(x**3, 0.0, 15.0)) < BOUND
        assert abs(deviate(x**4, 3.0, 96.0)) < BOUND


@pytest.mark.parametrize("threshold", [3.0, 4.0, 4.5, 5.0])
def test_tails_hold_as_many_as_the_normal(threshold: float) -> None:
    beyond = 0
    total = 0
    for seed, step in itertools.product(SEEDS, range(1, 21)):
        x = draw(seed, 3, step)
        beyond += int(np.sum(np.abs(x) > threshold))
        total += x.size
    expected = total * 2.0 * stats.norm.sf(threshold)
    assert 5e-7 < stats.poisson.cdf(beyond, expected) < 1.0 - 5e-7


def test_both_tails_reach_as_far_as_they_should() -> None:
    x = np.concatenate([draw(7, 0, step).ravel() for step in range(1, 41)])
    assert 4.7 < -x.min() < 6.7
    assert 4.7 < x.max() < 6.7


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("stream", [0, 1, 17])
def test_kolmogorov_smirnov(seed: int, stream: int) -> None:
    for x in draw(seed, stream, 5):
        assert stats.kstest(x, "norm").pvalue > 1e-6


def correlated(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Return the largest standardised correlation among the values, their squares and magnitudes."""
    pairs = [(a, b), (a**2 - 1.0, b**2 - 1.0), (a, b**2 - 1.0), (np.abs(a) - math.sqrt(2 / math.pi), b)]
    return max(
        abs(float(np.sum(u * v)) / math.sqrt(float(np.sum(u * u)) * float(np.sum(v * v)))) * math.sqrt(u.size)
        for u, v in pairs
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_the_two_rows_of_a_pair_are_independent(seed: int) -> None:
    for step in range(1, 9):
        a, b = draw(seed, 0, step)
        assert correlated(a, b) < BOUND


@pytest.mark.parametrize("lag", [1, 2, 3, 4, 8, 64, 256, 1024, 4096, 65536])
def test_neighbouring_particles_are_independent(lag: int) -> None:
    for x in draw(11, 0, 3):
        assert correlated(x[:-lag], x[lag:]) < BOUND


@pytest.mark.parametrize("lag", [1, 2, 3, 16, 256, 65536, 1 << 20])
def test_ticks_are_independent(lag: int) -> None:
    for a, b in itertools.product(draw(11, 0, 1000), draw(11, 0, 1000 + lag)):
        assert correlated(a, b) < BOUND


@pytest.mark.parametrize(("one", "other"), [(0, 1), (0, 2), (1, 2), (0, 16), (5, 1 << 20)])
def test_streams_are_independent(one: int, other: int) -> None:
    for a, b in itertools.product(draw(11, one, 9), draw(11, other, 9)):
        assert correlated(a, b) < BOUND


@pytest.mark.parametrize(("one", "other"), [(0, 1), (1, 2), (3, 2**32 + 3), (0, 2**63)])
def test_seeds_are_independent(one: int, other: int) -> None:
    for a, b in itertools.product(draw(one, 0, 9), draw(other, 0, 9)):
        assert correlated(a, b) < BOUND


def test_one_particle_over_time_is_normal_and_white() -> None:
    x = np.array([draw(4, 0, step, first=12345, count=1)[:, 0] for step in range(1, 40_001)])
    for column in x.T:
        assert stats.kstest(column, "norm").pvalue > 1e-6
        for lag in (1, 2, 7):
            assert correlated(column[:-lag], column[lag:]) < BOUND


@pytest.mark.parametrize("lag", [0, 1, 2, 8])
def test_pairs_fill_the_square_evenly(lag: int) -> None:
    """The lattice test: pairs of uniform numbers in 64 by 64 cells, by chi-square."""
    a, b = draw(21, 2, 77)
    u = stats.norm.cdf(a)
    v = stats.norm.cdf(b) if lag == 0 else np.roll(u, lag)
    counts, _, _ = np.histogram2d(u, v, bins=64, range=[[0.0, 1.0], [0.0, 1.0]])
    assert 5e-7 < stats.chisquare(counts.ravel()).pvalue < 1.0 - 5e-7


def test_triples_fill_the_cube_evenly() -> None:
    x = stats.norm.cdf(draw(22, 0, 5)[0])
    triples = x[: x.size // 3 * 3].reshape(-1, 3)
    counts, _ = np.histogramdd(triples, bins=16, range=[(0.0, 1.0)] * 3)
    assert 5e-7 < stats.chisquare(counts.ravel()).pvalue < 1.0 - 5e-7


def test_radius_and_angle_are_independent() -> None:
    a, b = draw(23, 0, 5)
    radius = 1.0 - np.exp(-0.5 * (a * a + b * b))
    angle = np.arctan2(b, a)
    counts, _, _ = np.histogram2d(radius, angle, bins=48, range=[[0.0, 1.0], [-math.pi, math.pi]])
    assert 5e-7 < stats.chisquare(counts.ravel()).pvalue < 1.0 - 5e-7


@pytest.mark.interpreted
def test_a_number_depends_on_the_particle_not_on_the_block() -> None:
    whole = draw(1, 0, 5, count=5000)
    parts = [draw(1, 0, 5, first=first, count=count) for first, count in [(0, 7), (7, 4093), (4100, 900)]]
    assert np.array_equal(whole, np.concatenate(parts, axis=1))


def test_numbers_have_not_changed() -> None:
    """A replay of an old recording must give the same bytes: these are the first numbers of seed 1."""
    first = draw(1, 0, 1, count=3)
    assert first.astype(np.float32).tobytes().hex() == FIRST


FIRST = "ed53bc3d275bbe3fe159093f3e37173ff38fd03e50d6fbbe"


@pytest.mark.interpreted
def test_uniform_is_uniform_and_open() -> None:
    x = np.array([random.uniform(3, 1, step) for step in range(20_000)])
    assert x.min() > 0.0
    assert x.max() < 1.0
    assert stats.kstest(x, "uniform").pvalue > 1e-6
    assert abs(np.corrcoef(x[:-1], x[1:])[0, 1]) * math.sqrt(x.size) < BOUND
