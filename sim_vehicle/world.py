"""The truth: where the rover is, how it moves, how far its wheels have rolled.

The body moves on flat ground. Within one step of the grid the rates change linearly, and the step's arc is
exact for its mean rates, so a circle at a steady rate is a circle. Between the grid's points the truth is
interpolated; who asks does not change the drive.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from sim_vehicle.course import Driver, View
from sim_vehicle.rover import Command, Motion, Rover

GRAVITY = 9.80665


@dataclass(frozen=True, slots=True)
class Pose:
    """Where the drive begins: metres north, east and down, heading in radians clockwise from north."""

    north: float = 0.0
    east: float = 0.0
    down: float = 0.0
    heading: float = 0.0


@dataclass(frozen=True, slots=True)
class Truth:
    """The true state at one instant.

    Attributes
    ----------
    time : float
        Seconds since the drive began.
    north, east, down : float
        Metres from the origin.
    heading : float
        Radians clockwise from north; not wrapped, it goes on growing.
    speed, yaw_rate, acceleration : float
        Forward, m/s; about down, rad/s; forward, m/s².
    left, right : float
        How far the wheels have rolled, metres.
    command : Command
        What the driver asks for.
    """

    time: float
    north: float
    east: float
    down: float
    heading: float
    speed: float
    yaw_rate: float
    acceleration: float
    left: float
    right: float
    command: Command

    @property
    def wrapped_heading(self) -> float:
        """Heading in (-pi, pi]."""
        return math.remainder(self.heading, math.tau)

    @property
    def motion(self) -> Motion:
        """Speed and yaw rate as the rover knows them."""
        return Motion(self.speed, self.yaw_rate)

    @property
    def velocity(self) -> tuple[float, float, float]:
        """Velocity north, east and down, m/s."""
        return self.speed * math.cos(self.heading), self.speed * math.sin(self.heading), 0.0


class World:
    """A rover on its drive.

    Parameters
    ----------
    rover : Rover
        How it answers.
    driver : Driver
        Who commands it.
    start : Pose
        Where it stands at time 0.
    step : float
        Seconds between two points of the grid.
    """

    def __init__(self, rover: Rover, driver: Driver, start: Pose, step: float = 0.005) -> None:
        self._rover = rover
        self._driver = driver
        self._step = step
        self._count = 0
        self._motion = Motion()
        self._before = self._after = Truth(
            0.0, start.north, start.east, start.down, start.heading, 0.0, 0.0, 0.0, 0.0, 0.0, Command()
        )

    def at(self, time: float) -> Truth:
        """Return the truth at a time.

        Raises
        ------
        ValueError
            The time lies before the step that the world has reached: it only goes forward.
        """
        if time < self._before.time:
            raise ValueError(f"world: {time:.4f} s has passed, the drive is at {self._before.time:.4f} s")
        while self._after.time < time:
            self._before, self._after = self._after, self._advanced(self._after)
        return self._between(time)

    def _advanced(self, now: Truth) -> Truth:
        view = View(now.time, now.north, now.east, now.heading, now.speed)
        command = self._driver.command(view)
        before, after = self._motion, self._rover.respond(self._motion, command, self._step)
        mean = Motion(0.5 * (before.speed + after.speed), 0.5 * (before.yaw_rate + after.yaw_rate))
        half_turn = 0.5 * mean.yaw_rate * self._step
        chord = mean.speed * self._step * (math.sin(half_turn) / half_turn if half_turn else 1.0)
        left, right = self._rover.wheel_speeds(mean)
        self._motion = after
        self._count += 1
        return Truth(
            time=self._count * self._step,
            north=now.north + chord * math.cos(now.heading + half_turn),
            east=now.east + chord * math.sin(now.heading + half_turn),
            down=now.down,
            heading=now.heading + 2.0 * half_turn,
            speed=after.speed,
            yaw_rate=after.yaw_rate,
            acceleration=(after.speed - before.speed) / self._step,
            left=now.left + left * self._step,
            right=now.right + right * self._step,
            command=command,
        )

    def _between(self, time: float) -> Truth:
        before, after = self._before, self._after
        if after.time <= before.time:
            return after
        share = (time - before.time) / (after.time - before.time)

        def mix(first: float, second: float) -> float:
            return first + share * (second - first)

        return Truth(
            time=time,
            north=mix(before.north, after.north),
            east=mix(before.east, after.east),
            down=mix(before.down, after.down),
            heading=mix(before.heading, after.heading),
            speed=mix(before.speed, after.speed),
            yaw_rate=mix(before.yaw_rate, after.yaw_rate),
            acceleration=after.acceleration,
            left=mix(before.left, after.left),
            right=mix(before.right, after.right),
            command=after.command,
        )
