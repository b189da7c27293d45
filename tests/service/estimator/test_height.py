"""The height beside the particles, with the biases of its altitudes, against a Kalman filter."""

from __future__ import annotations

import math

import numpy as np
import pytest

from filters.kalman import KalmanFilter
from filters.motion.learned import Learned
from filters.sensing.altitude import Altitude, AltitudeMeasurement
from service.estimator.height import CLIMB, Height
from service.estimator.start import Anchor

WEATHER = Learned("altitude_bias", 0.05, 100.0)
OUTLIER = math.log(0.05 / 1000.0)


def test_it_is_a_kalman_filter_of_height_and_weather() -> None:
    height, sensor = Height([WEATHER]), Altitude(0.3, bias="altitude_bias")
    height.begin(Anchor((0.0, 0.0, -3.0), (1.0, 1.0, 2.0)))
    oracle = KalmanFilter(np.array([-3.0, 0.0]), np.diag([4.0, 1e4]))
    rng = np.random.default_rng(1)
    for turn in range(30):
        height.wander(0.2)
        oracle.predict(np.eye(2), np.diag([CLIMB**2 * 0.2, 0.05**2 * 0.2]))
        up = 62.0 + rng.normal(0.0, 0.3)
        evidence = height.weigh(sensor, AltitudeMeasurement(up), OUTLIER)
        assert evidence is not None
        assert evidence.accepted
        oracle.correct(np.array([up]), np.array([[-1.0, 1.0]]), np.array([[0.09]]))
        if turn % 10 == 0:
            height.correct(-2.0, 9.0)
            oracle.correct(np.array([-2.0]), np.array([[1.0, 0.0]]), np.array([[9.0]]))
    assert height.moments == pytest.approx((oracle.mean[0], oracle.covariance[0, 0]))
    assert height.biases["altitude_bias"] == pytest.approx(
        (oracle.mean[1], math.sqrt(oracle.covariance[1, 1]))
    )
    assert height.down == pytest.approx(oracle.mean[0])


def test_an_outlier_is_left_out_and_says_how_unlikely_it_was() -> None:
    height, sensor = Height(), Altitude(0.5)
    height.begin(Anchor((0.0, 0.0, 0.0), (1.0, 1.0, 0.5)))
    before = height.moments
    evidence = height.weigh(sensor, AltitudeMeasurement(40.0), OUTLIER)
    assert evidence is not None
    assert height.moments == before
    variance = 0.25 + 0.25
    assert evidence.log_mean == pytest.approx(-0.5 * (1600.0 / variance + math.log(2.0 * math.pi * variance)))
    assert evidence.innovation == pytest.approx(40.0)


def test_a_first_altitude_is_a_beginning_but_not_one_of_unknown_bias() -> None:
    height = Height([WEATHER])
    assert height.weigh(Altitude(0.5, bias="altitude_bias"), AltitudeMeasurement(40.0), OUTLIER) is None
    assert height.moments is None
    assert height.biases == {}
    assert height.down == 0.0
    assert height.weigh(Altitude(0.5), AltitudeMeasurement(40.0), OUTLIER) is not None
    assert height.moments == pytest.approx((-40.0, 0.25))


def test_an_old_altitude_is_worth_less() -> None:
    young, old = Height(), Height()
    for height, age in ((young, 0.0), (old, 100.0)):
        height.begin(Anchor((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)))
        height.weigh(Altitude(0.5), AltitudeMeasurement(1.0), OUTLIER, age)
    assert young.moments == pytest.approx((-1.0 / 1.25, 0.25 / 1.25))
    noise = 0.25 + CLIMB**2 * 100.0
    assert old.moments == pytest.approx((-1.0 / (1.0 + noise), noise / (1.0 + noise)))


def test_what_cannot_be_is_refused() -> None:
    height = Height()
    height.begin(Anchor((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)))
    evidence = height.weigh(Altitude(0.5), AltitudeMeasurement(1.0, -1.0), OUTLIER)
    assert evidence is not None
    assert not evidence.accepted
