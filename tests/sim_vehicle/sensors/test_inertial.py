"""The inertial unit: bias, walk, white noise, and what a level body feels."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_vehicle.chance import stream
from sim_vehicle.sensors import Cadence, Inertial, InertialSettings
from sim_vehicle.world import GRAVITY
from tests.sim_vehicle.sensors.truths import straight, turning

CADENCE = Cadence(100.0)


def test_a_perfect_unit_feels_the_turn_and_gravity() -> None:
    reading = Inertial(InertialSettings(CADENCE), stream(1, "i")).measure(
        turning(1.0, speed=2.0, yaw_rate=0.4)
    )
    assert reading.angular_velocity == pytest.approx((0.0, 0.0, 0.4))
    assert reading.specific_force == pytest.approx((0.3, 0.8, -GRAVITY))


def test_bias_and_white_noise_are_those_of_the_settings() -> None:
    """10,000 readings: five sigma of means and deviations; by chance rarer than 10^-5."""
    settings = InertialSettings(
        CADENCE,
        gyro_bias=(0.01, -0.02, 0.005),
        gyro_noise=2e-4,
        accelerometer_bias=(0.1, 0.0, -0.05),
        accelerometer_noise=2e-3,
    )
    unit = Inertial(settings, stream(1, "inertial"))
    readings = [unit.measure(straight(count / 100.0)) for count in range(10_000)]
    rates = np.array([reading.angular_velocity for reading in readings])
    forces = np.array([reading.specific_force for reading in readings])
    assert rates.mean(0) == pytest.approx([0.01, -0.02, 0.005], abs=5.0 * 2e-3 / 100.0)
    assert rates.std(0) == pytest.approx([2e-3] * 3, rel=5.0 / math.sqrt(20_000))
    assert forces.mean(0) == pytest.approx([0.1, 0.0, -GRAVITY - 0.05], abs=5.0 * 0.02 / 100.0)
    assert forces.std(0) == pytest.approx([0.02] * 3, rel=5.0 / math.sqrt(20_000))


def test_the_bias_walks_with_the_root_of_time() -> None:
    """500 units, 3 axes: the variance after 100 s is walk² · 100; five sigma of 1,500 values."""
    settings = InertialSettings(CADENCE, gyro_bias_walk=1e-4)
    ends = []
    for seed in range(500):
        unit = Inertial(settings, stream(seed, "inertial"))
        for count in range(1, 11):
            reading = unit.measure(straight(10.0 * count))
        ends.append(reading.angular_velocity)
    assert np.var(ends) == pytest.approx(1e-8 * 100.0, rel=5.0 * math.sqrt(2.0 / 1500))
