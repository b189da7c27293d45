"""The truth against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_vehicle.course import SteadyDriver
from sim_vehicle.rover import AckermannRover, Command, SkidRover
from sim_vehicle.world import Pose, Truth, World


def steady(speed: float, yaw_rate: float, start: Pose | None = None) -> World:
    """Return a world whose rover follows its command at once."""
    rover = SkidRover(track=0.5, turning_slip=1.0, acceleration=1e6, yaw_acceleration=1e6)
    return World(rover, SteadyDriver(Command(speed, yaw_rate)), start or Pose())


def test_a_steady_turn_is_a_circle() -> None:
    speed, yaw_rate = 1.4, 0.35
    world = steady(speed, yaw_rate, Pose(3.0, -2.0, 0.5, 0.8))
    first = world.at(0.005)
    for time in np.linspace(0.01, 40.0, 1600):
        truth = world.at(float(time))
        turned = yaw_rate * (truth.time - first.time)
        radius = speed / yaw_rate
        north = first.north + radius * (math.sin(first.heading + turned) - math.sin(first.heading))
        east = first.east - radius * (math.cos(first.heading + turned) - math.cos(first.heading))
        # Between grid points the chord stands for the arc: at most r (1 - cos(w dt / 2)) = 1.5e-6 m.
        assert (truth.north, truth.east) == pytest.approx((north, east), abs=2e-6)
        assert truth.heading == pytest.approx(first.heading + turned, abs=1e-9)
        assert truth.down == 0.5


def test_the_wheels_roll_as_far_as_their_circles_are_long() -> None:
    world = steady(1.0, 0.5)
    begin = world.at(0.005)
    begin_left, begin_right = begin.left, begin.right
    end = world.at(10.005)
    # Turning right (clockwise) the left wheel runs on the outer circle: (v + w b / 2) t.
    assert end.left - begin_left == pytest.approx((1.0 + 0.5 * 0.25) * 10.0, abs=1e-9)
    assert end.right - begin_right == pytest.approx((1.0 - 0.5 * 0.25) * 10.0, abs=1e-9)


def test_speed_grows_with_the_rovers_acceleration() -> None:
    world = World(SkidRover(acceleration=0.5), SteadyDriver(Command(2.0)), Pose(heading=math.pi / 2))
    truth = world.at(3.0)
    assert truth.speed == pytest.approx(1.5)
    assert truth.acceleration == pytest.approx(0.5)
    assert truth.east == pytest.approx(0.5 * 0.5 * 3.0**2)
    assert truth.north == pytest.approx(0.0, abs=1e-12)
    assert world.at(10.0).acceleration == 0.0


def test_an_ackermann_rover_turns_on_the_radius_of_its_steering() -> None:
    rover = AckermannRover(wheelbase=0.8, acceleration=1e6, steering_rate=1e6)
    world = World(rover, SteadyDriver(Command(1.0, 0.4)), Pose())
    begin, points = world.at(0.005), []
    for count in range(1, 300):
        truth = world.at(0.005 + 0.05 * count)
        points.append((truth.north, truth.east))
    centre = (begin.north - math.sin(begin.heading) / 0.4, begin.east + math.cos(begin.heading) / 0.4)
    radii = [math.dist(point, centre) for point in points]
    assert radii == pytest.approx([1.0 / 0.4] * len(radii), abs=1e-5)


def test_velocity_is_along_the_heading_and_the_heading_is_wrapped_on_request() -> None:
    truth = Truth(0.0, 0.0, 0.0, 0.0, math.tau + 2.0, 1.5, 0.0, 0.0, 0.0, 0.0, Command())
    assert truth.velocity == pytest.approx((1.5 * math.cos(2.0), 1.5 * math.sin(2.0), 0.0))
    assert truth.wrapped_heading == pytest.approx(2.0)


def test_who_looks_does_not_change_the_drive() -> None:
    seldom, often = steady(1.0, 0.3), steady(1.0, 0.3)
    for time in np.linspace(0.0, 4.9999, 977):
        often.at(float(time))
    assert often.at(5.0) == seldom.at(5.0)


def test_the_world_does_not_go_back() -> None:
    world = steady(1.0, 0.0)
    world.at(2.0)
    with pytest.raises(ValueError, match=r"1\.5000 s has passed"):
        world.at(1.5)
