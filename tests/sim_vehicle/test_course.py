"""The driver follows his course, stops where it says, and goes round."""

from __future__ import annotations

import itertools
import math

import pytest

from sim_vehicle.course import Course, CourseDriver, Waypoint
from sim_vehicle.rover import AckermannRover, Rover, SkidRover
from sim_vehicle.world import Pose, Truth, World

SQUARE = (
    Waypoint(20.0, 0.0, 1.5),
    Waypoint(20.0, 20.0, 2.0, pause=4.0),
    Waypoint(0.0, 20.0, 1.0),
    Waypoint(0.0, 0.0, 1.5),
)


def driven(rover: Rover, seconds: float) -> list[Truth]:
    world = World(rover, CourseDriver(Course(SQUARE)), Pose())
    return [world.at(count / 20.0) for count in range(int(20 * seconds))]


@pytest.mark.parametrize("rover", [SkidRover(), AckermannRover()])
def test_every_waypoint_is_passed_near(rover: Rover) -> None:
    drive = driven(rover, 150.0)
    for point in SQUARE:
        nearest = min(math.hypot(truth.north - point.north, truth.east - point.east) for truth in drive)
        assert nearest < 1.5


@pytest.mark.parametrize("rover", [SkidRover(), AckermannRover()])
def test_the_rover_stands_at_the_waypoint_that_says_so(rover: Rover) -> None:
    drive = driven(rover, 60.0)
    standing = [truth for truth in drive if truth.time > 5.0 and abs(truth.speed) < 1e-9]
    assert 3.5 <= len(standing) / 20.0 <= 4.5
    for truth in standing:
        assert math.hypot(truth.north - 20.0, truth.east - 20.0) < 0.5


def test_the_rover_waits_before_it_departs_and_keeps_to_the_leg_speed() -> None:
    drive = driven(SkidRover(), 12.0)
    assert all(truth.speed == 0.0 for truth in drive if truth.time < 2.0)
    assert max(truth.speed for truth in drive) == pytest.approx(1.5, abs=0.02)


def test_the_path_is_smooth() -> None:
    drive = driven(SkidRover(yaw_acceleration=1.5), 100.0)
    for before, after in itertools.pairwise(drive):
        assert abs(after.yaw_rate - before.yaw_rate) <= 1.5 * 0.05 + 1e-9
        assert abs(after.speed - before.speed) <= 0.8 * 0.05 + 1e-9
    assert max(abs(truth.yaw_rate) for truth in drive) <= 0.7 + 1e-9


@pytest.mark.parametrize(
    ("waypoints", "complaint"),
    [
        ((Waypoint(0.0, 0.0),), "at least 2 waypoints, got 1"),
        ((Waypoint(0.0, 0.0), Waypoint(1.0, 0.0), Waypoint(1.0, 0.0)), "waypoint 2 lies on the one before"),
        ((Waypoint(1.0, 0.0), Waypoint(0.0, 0.0), Waypoint(1.0, 0.0)), "waypoint 0 lies on the one before"),
    ],
)
def test_a_course_that_cannot_be_driven_is_refused(waypoints: tuple[Waypoint, ...], complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        Course(waypoints)
