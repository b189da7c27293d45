"""Where the rover drives: waypoints with a speed and a pause each, and the driver who follows them.

The driver steers by pure pursuit (Coulter, 1992): toward a point on the course some metres ahead, with the
curvature 2 sin(angle) / distance. He sees the truth, as a person at the wheel does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from sim_vehicle.rover import Command


@dataclass(frozen=True, slots=True)
class Waypoint:
    """A point to drive to, metres; the speed on the way, m/s; how long to stand still there, seconds."""

    north: float
    east: float
    speed: float = 1.5
    pause: float = 0.0


@dataclass(frozen=True, slots=True)
class Course:
    """Waypoints, driven round and round.

    Attributes
    ----------
    waypoints : tuple[Waypoint, ...]
        At least two, no two neighbours at one place.
    look_ahead : float
        How far ahead on the course the driver aims, metres.
    braking : float
        Deceleration before a stop, m/s².
    departure : float
        Seconds of standing still before the drive.
    """

    waypoints: tuple[Waypoint, ...]
    look_ahead: float = 2.5
    braking: float = 0.4
    departure: float = 2.0

    def __post_init__(self) -> None:
        """Refuse a course that cannot be driven."""
        if len(self.waypoints) < 2:
            raise ValueError(f"course: needs at least 2 waypoints, got {len(self.waypoints)}")
        for index, point in enumerate(self.waypoints):
            before = self.waypoints[index - 1]
            if math.hypot(point.north - before.north, point.east - before.east) < 1e-6:
                raise ValueError(f"course: waypoint {index} lies on the one before it; move or remove it")


@dataclass(frozen=True, slots=True)
class View:
    """What the driver sees: time since the drive began (s), position (m), heading (rad), speed (m/s)."""

    time: float
    north: float
    east: float
    heading: float
    speed: float


class Driver(Protocol):
    """Whoever commands the rover."""

    def command(self, view: View) -> Command:
        """Return the command for what is seen; called once per step, in order of time."""
        ...


@dataclass(frozen=True, slots=True)
class SteadyDriver:
    """Always the same command: a straight line, a circle, standing still."""

    steady: Command

    def command(self, view: View) -> Command:
        """Return the command, whatever is seen."""
        return self.steady


class CourseDriver:
    """Follows a course by pure pursuit, slows in turns, stops where the course says so.

    Parameters
    ----------
    course : Course
        Its first leg leads from the last waypoint to the first: start on that line.
    yaw_rate_limit : float
        Largest yaw rate that the driver asks for, rad/s.
    """

    def __init__(self, course: Course, yaw_rate_limit: float = 0.7) -> None:
        self._course = course
        self._yaw_rate_limit = yaw_rate_limit
        self._next = 0
        self._standing_until = course.departure

    def command(self, view: View) -> Command:
        """Return the command for what is seen: toward the course ahead, or standing still."""
        if view.time < self._standing_until:
            return Command()
        remaining = self._advance(view)
        if view.time < self._standing_until:
            return Command()
        target = self._course.waypoints[self._next]
        speed = target.speed
        if target.pause > 0.0:
            speed = min(speed, math.sqrt(2.0 * self._course.braking * max(remaining, 0.0)) + 0.05)
        return self._steer(view, speed, remaining)

    def _leg(self, index: int) -> tuple[Waypoint, float, float, float]:
        """Return the start of the leg to a waypoint, its direction (north, east) and its length."""
        start = self._course.waypoints[index - 1]
        end = self._course.waypoints[index]
        north, east = end.north - start.north, end.east - start.east
        length = math.hypot(north, east)
        return start, north / length, east / length, length

    def _remaining(self, view: View) -> float:
        start, north, east, length = self._leg(self._next)
        return length - ((view.north - start.north) * north + (view.east - start.east) * east)

    def _advance(self, view: View) -> float:
        """Turn to the next waypoint when this one is reached; return the metres left on the leg."""
        remaining = self._remaining(view)
        target = self._course.waypoints[self._next]
        reached = 0.1 if target.pause > 0.0 else 0.4 * self._course.look_ahead
        if remaining <= reached:
            self._standing_until = view.time + target.pause
            self._next = (self._next + 1) % len(self._course.waypoints)
            remaining = self._remaining(view)
        return remaining

    def _aim(self, remaining: float) -> tuple[float, float]:
        """Return the point of the course at the look-ahead distance, round the corner where nobody stops."""
        index, ahead = self._next, self._course.look_ahead - remaining
        target = self._course.waypoints[index]
        if ahead > 0.0 and target.pause == 0.0:
            index = (index + 1) % len(self._course.waypoints)
            start, north, east, length = self._leg(index)
            along = min(ahead, length)
        else:
            # Beyond a stop the line goes on straight: a point too near would make the last metres swerve.
            start, north, east, length = self._leg(index)
            along = length - remaining + self._course.look_ahead
        return start.north + along * north, start.east + along * east

    def _steer(self, view: View, speed: float, remaining: float) -> Command:
        north, east = self._aim(remaining)
        distance = max(math.hypot(north - view.north, east - view.east), 0.5)
        angle = math.remainder(math.atan2(east - view.east, north - view.north) - view.heading, math.tau)
        if abs(angle) > 0.5 * math.pi:
            slow = 0.3 * speed
            return Command(slow, math.copysign(self._yaw_rate_limit, angle))
        speed *= max(0.3, math.cos(angle))
        wanted = 2.0 * max(speed, 0.3) * math.sin(angle) / distance
        return Command(speed, min(self._yaw_rate_limit, max(-self._yaw_rate_limit, wanted)))
