"""The autopilot's yaw filter."""

from __future__ import annotations

import math

import pytest

from sim_vehicle.attitude import AttitudeFilter


def test_without_a_compass_it_integrates_the_gyro() -> None:
    attitude = AttitudeFilter()
    for count in range(101):
        attitude.turn(0.1 * count, 0.2)
    assert attitude.yaw == pytest.approx(2.0)


def test_with_a_compass_it_learns_the_bias_of_the_gyro() -> None:
    attitude = AttitudeFilter()
    attitude.align(0.0, 3.0)
    assert attitude.yaw == 3.0
    for count in range(1, 12_001):
        time = 0.01 * count
        true = math.remainder(3.0 + 0.1 * time, math.tau)
        attitude.turn(time, 0.1 + 0.02)
        attitude.align(time, true)
    assert math.remainder(attitude.yaw - (3.0 + 0.1 * 120.0), math.tau) == pytest.approx(0.0, abs=1e-3)
