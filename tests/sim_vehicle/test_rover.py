"""Rovers within their limits."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_vehicle.rover import AckermannRover, Command, Motion, SkidRover

rates = st.floats(-5.0, 5.0)


@given(rates, rates, rates, rates, st.floats(0.001, 0.1))
def test_a_skid_rover_never_exceeds_its_accelerations(
    speed: float, yaw_rate: float, asked_speed: float, asked_yaw_rate: float, duration: float
) -> None:
    rover = SkidRover(acceleration=0.8, yaw_acceleration=1.5)
    after = rover.respond(Motion(speed, yaw_rate), Command(asked_speed, asked_yaw_rate), duration)
    assert abs(after.speed - speed) <= 0.8 * duration + 1e-12
    assert abs(after.yaw_rate - yaw_rate) <= 1.5 * duration + 1e-12
    assert min(speed, asked_speed) - 1e-12 <= after.speed <= max(speed, asked_speed) + 1e-12


def test_a_skid_rover_turns_on_the_spot_and_its_wheels_scrub() -> None:
    rover = SkidRover(track=0.4, turning_slip=1.5)
    assert rover.wheel_speeds(Motion(0.0, 1.0)) == pytest.approx((0.3, -0.3))


@given(st.floats(0.2, 3.0), rates)
def test_an_ackermann_rover_stays_within_its_steering(speed: float, yaw_rate: float) -> None:
    rover = AckermannRover(wheelbase=0.8, steering_limit=0.6, steering_rate=1.2)
    motion = Motion()
    for _ in range(400):
        before = motion
        motion = rover.respond(motion, Command(speed, yaw_rate), 0.01)
        assert abs(motion.steering) <= 0.6 + 1e-12
        assert abs(motion.steering - before.steering) <= 0.012 + 1e-12
    reachable = speed * math.tan(0.6) / 0.8
    assert motion.yaw_rate == pytest.approx(max(-reachable, min(reachable, yaw_rate)), abs=1e-6)


def test_an_ackermann_rover_does_not_turn_where_it_stands() -> None:
    rover = AckermannRover()
    assert rover.respond(Motion(), Command(0.0, 1.0), 0.1).yaw_rate == 0.0
    left, right = rover.wheel_speeds(Motion(1.0, 0.5))
    assert (left, right) == pytest.approx((1.0 + 0.5 * 0.3, 1.0 - 0.5 * 0.3))
