"""Standing still: the bias comes out as a Kalman filter of one dimension has it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from filters.kalman import KalmanFilter
from filters.motion.standing import StandingUnicycle


def _motion(sigma: float = 0.01) -> StandingUnicycle:
    return StandingUnicycle(0.1, 0.02, 1e-4, 1e-4, gyro_bias_sigma=sigma)


def test_mean_and_variance_are_the_kalman_filters() -> None:
    """To the seven digits of single precision."""
    chance = np.random.default_rng(2)
    motion = _motion()
    biases = chance.normal(0.003, 0.004, 2000).astype(np.float32)
    weights = chance.random(2000).astype(np.float32)
    share = weights / weights.sum(dtype=np.float64)
    mean = float(share @ biases)
    spread = float(share @ (biases - mean) ** 2)
    oracle = KalmanFilter([mean], [[spread + 1e-4]])
    for turn in (0.0012, 0.0009, 0.0011):
        oracle.predict(np.eye(1), [[1e-8 * 0.1]])
        oracle.correct([turn / 0.1], np.eye(1), [[1e-6 / 0.1]])
        motion.stand(biases, weights, turn, 0.1)
    mean = float(share @ biases)
    variance = float(share @ (biases - mean) ** 2) + motion.conditional_variances["gyro_bias"]
    assert mean == pytest.approx(float(oracle.mean[0]), rel=1e-5)
    assert variance == pytest.approx(float(oracle.covariance[0, 0]), rel=1e-4)


def test_a_minute_of_standing_leaves_the_bias_that_the_gyro_read() -> None:
    motion, biases, weights = _motion(), np.zeros(500, np.float32), np.ones(500, np.float32)
    for _ in range(600):
        motion.stand(biases, weights, 0.1 * -0.0054, 0.1)
    assert biases.mean() == pytest.approx(-0.0054, abs=1e-5)
    assert math.sqrt(motion.conditional_variances["gyro_bias"]) < 4e-4


def test_no_time_teaches_nothing_and_what_is_not_finite_is_refused() -> None:
    motion, biases, weights = _motion(), np.zeros(5, np.float32), np.ones(5, np.float32)
    before = motion.conditional_variances
    motion.stand(biases, weights, 0.0, 0.0)
    for turn, duration, noise in ((math.nan, 0.1, 1e-3), (0.0, -1.0, 1e-3), (0.0, 0.1, 0.0)):
        with pytest.raises(ValueError, match="standing: finite numbers"):
            motion.stand(biases, weights, turn, duration, noise)
    assert motion.conditional_variances == before
    assert not biases.any()
