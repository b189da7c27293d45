"""Headings drawn apart: moments stay, circles are left alone, and a good gyro leaves the belief that Kalman's is."""

from __future__ import annotations

import math

import numpy as np
import pytest

from filters.loosening import Columns, loosen
from filters.motion.unicycle import GYRO_BIAS, ODOMETRY_SCALE, Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.regularization import silverman
from filters.sensing import Position, PositionMeasurement

COUNT = 4000
SPEED, STEP, SIGMA, GYRO = 1.5, 0.1, 0.3, 3e-4


def cloud(seed: int = 1) -> tuple[Columns, Columns]:
    """Return headings and four other columns, two of which they depend on; one column is the same for all."""
    random = np.random.default_rng(seed)
    others = random.standard_normal((4, COUNT)) * [[3.0], [2.0], [1e-3], [0.0]] + [
        [800.0],
        [-900.0],
        [0.0],
        [1.0],
    ]
    own = 0.05 * random.standard_normal(COUNT)
    heading = 0.5 + own + 0.02 * (others[0] - 800.0) + 20.0 * others[2]
    return heading.astype(np.float32), others.astype(np.float32)


def test_variance_and_covariance_with_all_others_stay() -> None:
    """Exactly, in the sample, up to single precision: the variance taken off is the one given back."""
    heading, others = cloud()
    loosened = loosen(heading, others, COUNT / 2)
    assert loosened is not None
    taken, variance = loosened
    after = heading.astype(np.float64) - taken
    assert after.mean() == pytest.approx(float(heading.mean(dtype=np.float64)), abs=1e-6)
    assert after.var() + variance == pytest.approx(float(heading.var(dtype=np.float64)), rel=1e-4)
    for other in others[:3].astype(np.float64):
        assert abs(np.cov(other, taken)[0, 1]) < 1e-4 * other.std() * heading.std()


def test_what_is_given_back_is_the_residual_s_share() -> None:
    """Against least squares by numpy: h² of the variance that the others leave open."""
    heading, others = cloud(2)
    loosened = loosen(heading, others, 1000.0)
    assert loosened is not None
    around = np.vstack((others[:3] - others[:3].mean(axis=1, keepdims=True), np.ones(COUNT))).T.astype(
        np.float64
    )
    squares = float(np.linalg.lstsq(around, heading.astype(np.float64), rcond=None)[1][0])
    assert loosened[1] == pytest.approx(silverman(1000.0, 5) ** 2 * squares / COUNT, rel=2e-3)


def test_headings_across_south_are_no_circle_and_any_heading_is_left_alone() -> None:
    heading, others = cloud(3)
    turned = np.remainder(heading - 0.5 + 2.0 * math.pi, 2.0 * math.pi).astype(np.float32) - np.float32(
        math.pi
    )
    straight, wrapped = loosen(heading, others, 500.0), loosen(turned, others, 500.0)
    assert straight is not None
    assert wrapped is not None
    assert wrapped[1] == pytest.approx(straight[1], rel=1e-3)
    assert loosen(np.linspace(-3.1, 3.1, COUNT).astype(np.float32), others, 500.0) is None


def driven(seed: int, seconds: float = 120.0) -> tuple[float, float]:
    """Drive straight with fixes and a gyro that hardly errs; return how far heading and its sigma are off Kalman's.

    The first in Kalman's standard deviations, the second as a quotient. North, east and heading about a straight way
    are linear: e' = e + v T θ, so that the Kalman filter of (east, heading) is exact.
    """
    chance = np.random.default_rng(seed)
    motion = Unicycle(0.05, GYRO, 0.0, 0.0)
    belief = ParticleFilter(motion, capacity=1000, seed=seed)
    start = {"north": 0.5 * chance.standard_normal(1000), "east": 0.5 * chance.standard_normal(1000)}
    start |= {"heading": 0.1 * chance.standard_normal(1000)}
    belief.initialize(start | {GYRO_BIAS: np.zeros(1000), ODOMETRY_SCALE: np.ones(1000)})
    mean, covariance = np.zeros(2), np.diag([0.25, 0.01])
    heading = 0.1 * chance.standard_normal()
    north = east = 0.0
    moved = np.array([[1.0, SPEED * STEP], [0.0, 1.0]])
    for _ in range(round(seconds / STEP)):
        north += SPEED * STEP
        heading += GYRO * math.sqrt(STEP) * chance.standard_normal()
        east += SPEED * STEP * heading
        belief.predict(UnicycleControl(SPEED * STEP, 0.0), STEP)
        mean, covariance = moved @ mean, moved @ covariance @ moved.T + np.diag([0.0, GYRO**2 * STEP])
        fix = PositionMeasurement(
            north + SIGMA * chance.standard_normal(), east + SIGMA * chance.standard_normal()
        )
        belief.weigh(Position(SIGMA, outliers=0.0), fix)
        gain = covariance[:, 0] / (covariance[0, 0] + SIGMA**2)
        mean = mean + gain * (fix.east - mean[0])
        covariance = covariance - np.outer(gain, covariance[0])
        belief.normalize()
        if belief.effective_sample_size < 500:
            worth = belief.effective_sample_size
            belief.resample(1000)
            belief.reopen(worth)
    moments = belief.moments()
    sigma = math.sqrt(covariance[1, 1])
    return (float(moments.mean[2]) - mean[1]) / sigma, math.sqrt(float(moments.variance[2])) / sigma


def test_a_good_gyro_s_belief_is_kalman_s() -> None:
    """Five drives of a minute, to what a thousand particles are worth."""
    drives = [driven(seed, 60.0) for seed in range(5)]
    assert math.sqrt(math.fsum(off * off for off, _ in drives) / len(drives)) < 1.5
    assert all(0.7 < wide < 1.4 for _, wide in drives)


def test_a_few_ancestors_headings_come_apart() -> None:
    """Of twenty among 4,000 copies: mean and variance stay, to four sigmas of the draws; no two are alike."""
    belief = ParticleFilter(Unicycle(0.1, 1e-4, 0.0, 0.0), capacity=COUNT, seed=6)
    random = np.random.default_rng(9)
    start = {name: random.standard_normal(COUNT) for name in ("north", "east")}
    few = math.pi + 0.1 * np.repeat(random.standard_normal(20), COUNT // 20)
    belief.initialize(start | {"heading": few, GYRO_BIAS: np.zeros(COUNT), ODOMETRY_SCALE: np.ones(COUNT)})
    belief.reopen(20.0)
    after = belief.column("heading")
    assert np.all(np.abs(after) <= np.float32(math.pi))
    around = np.remainder(after.astype(np.float64), 2.0 * math.pi)
    four_sigmas = 4.0 * float(few.std()) / COUNT**0.5
    assert abs(float(around.mean() - few.mean())) < four_sigmas
    assert abs(float(around.std() - few.std())) < four_sigmas
    assert np.unique(after).size > 0.9 * COUNT
