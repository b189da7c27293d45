"""Speeds of whatever says one, and the reasons why it says none."""

from __future__ import annotations

import pytest

from drivers.sample import MotorSpeed, Odometer, Speed
from service.config import Sensor
from service.estimator.speedometer import Speedometer, matches

SECOND = 1_000_000_000


def test_a_speed_is_taken_as_it_is() -> None:
    assert Speedometer(None, None).read(0, Speed(-2.5, 0.1)) == Speed(-2.5, 0.1)
    assert Speedometer(None, None).read(0, Speed(2e4)) == "too_fast"


def test_a_motor_turns_a_wheel() -> None:
    assert Speedometer(None, 0.2).read(0, MotorSpeed(3, 10.0)) == Speed(2.0)
    assert Speedometer(None, None).read(0, MotorSpeed(3, 10.0)) == "no_wheel_radius"


def test_a_distance_says_a_speed_since_the_one_before() -> None:
    """A counter that started anew, or a gap, is a beginning; a repeated or overtaken stamp is counted."""
    one, mean = Speedometer(1, None), Speedometer(None, None)
    for time, wheels, of_one, of_both in (
        (0, (1.0, 2.0), "first_count", "first_count"),
        (SECOND // 10, (1.1, 2.3), 3.0, 2.0),
        (SECOND // 10, (1.1, 2.3), "out_of_order", "out_of_order"),
        (SECOND // 5, (1.1, 2.1), -2.0, -1.0),
        (2 * SECOND, (1.1, 2.1), "first_count", "first_count"),
    ):
        for speedometer, expected in ((one, of_one), (mean, of_both)):
            said = speedometer.read(time, Odometer(wheels))
            assert (said.speed if isinstance(said, Speed) else said) == pytest.approx(expected)
    assert one.read(21 * SECOND // 10, Odometer((0.0, 0.0), 1)) == "first_count"
    assert one.read(22 * SECOND // 10, Odometer((0.0,), 1)) == "no_such_wheel"
    assert mean.read(22 * SECOND // 10, Odometer((0.0,), 1)) == "first_count"


def test_a_sensor_hears_its_own_link_source_and_motor() -> None:
    named = Sensor(kind="speed", link="bus", source="esc.Status", index=1)
    assert matches(named, "bus", "esc.Status", MotorSpeed(1, 0.0))
    assert not matches(named, "bus", "esc.Status", MotorSpeed(0, 0.0))
    assert not matches(named, "can1", "esc.Status", MotorSpeed(1, 0.0))
    assert not matches(named, "bus", "RPM", MotorSpeed(1, 0.0))
    assert matches(Sensor(kind="speed"), "bus", "anything", Odometer((1.0,)))
