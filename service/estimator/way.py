"""The way that a vehicle went lately, as seen from where it is at one moment: what a search for that moment needs.

A search does not know the heading, so it cannot place the way on the map. But the way's shape is known from the
controls: whoever supposes a pose at one moment has supposed all poses of the last seconds, up to a few unknowns (the
gyro's bias, the odometer's scale) and the process noise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.sample import SECOND
from filters.motion.unicycle import GYRO_BIAS, ODOMETRY_SCALE
from service.config import Configuration
from service.estimator.free import FreeVehicle
from service.estimator.ground import GroundVehicle
from service.estimator.vehicle import Vehicle

Array = NDArray[np.float64]
Unknowns = dict[str, tuple[float, float]]
"""Mean and standard deviation of what the way leaves open, by the name of its column."""

BIAS_STEP = 0.01
"""rad/s; difference over which the way's dependence on the gyro's bias is taken."""

_NORTH = "velocity_north"
_EAST = "velocity_east"


class Poses(NamedTuple):
    """Where supposed vehicles were at some times, (times, n) each."""

    north: Array
    east: Array
    heading: Array


class Shape(Protocol):
    """The way at some times, relative to the pose at one moment."""

    @property
    def variance(self) -> Array:
        """Of the place at each time given the pose at the moment, per axis, m², (times,)."""
        ...

    @property
    def turn_variance(self) -> Array:
        """Of the heading at each time, rad², (times,)."""
        ...

    @property
    def reach(self) -> Array:
        """How far from the place at the moment each time's place may be, metres, (times,)."""
        ...

    def poses(self, columns: Mapping[str, Array]) -> Poses:
        """Return the poses at the times of those who are at ``columns`` (n,) at the moment."""
        ...


class Way(Protocol):
    """Follows a vehicle's motion and remembers some seconds of it."""

    @property
    def unknowns(self) -> Unknowns:
        """What the way leaves open, beside the pose."""
        ...

    def moved(self, start: int, end: int) -> None:
        """Note the stretch from ``start`` to ``end`` (nanoseconds)."""
        ...

    def shape(self, moment: int, times: Sequence[int]) -> Shape:
        """Return the way at ``times`` relative to the pose at ``moment``."""
        ...


ROOM = 4096
"""Stretches that there is room for: more than a vehicle has in the time that is remembered."""

_DURATION, _DISTANCE, _TURN, _ALONG, _SWING = range(5)


class GroundWay:
    """The way of a unicycle: distances and turns, added up.

    Parameters
    ----------
    vehicle : GroundVehicle
        Whose controls are read.
    configuration : Configuration
        What gyro and odometer may be off by.
    seconds : float
        How much is remembered.
    """

    def __init__(self, vehicle: GroundVehicle, configuration: Configuration, seconds: float) -> None:
        self._vehicle = vehicle
        self._span = round(seconds * SECOND)
        self._ends = np.zeros(ROOM, np.int64)
        self._table = np.zeros((ROOM, 5))
        self._last = 0
        motion = configuration.motion
        self.unknowns: Unknowns = {
            GYRO_BIAS: (0.0, motion.gyro_bias_sigma),
            ODOMETRY_SCALE: (1.0, motion.odometry_scale_sigma),
        }

    def moved(self, start: int, end: int) -> None:
        """Note the stretch from ``start`` to ``end`` (nanoseconds)."""
        control, duration = self._vehicle.control(start, end), (end - start) / SECOND
        along, swing = self._vehicle.motion.noise_variances(control, duration)
        if self._last == ROOM:
            self._compact(end)
        self._ends[self._last] = end
        self._table[self._last] = duration, control.distance, control.turn, along, swing
        self._last += 1

    def _compact(self, end: int) -> None:
        """Make room: forget what is older than the span, and at least half of all."""
        kept = max(int(np.searchsorted(self._ends, end - self._span)), ROOM // 2)
        self._last = ROOM - kept
        self._ends[: self._last] = self._ends[kept:].copy()
        self._table[: self._last] = self._table[kept:].copy()

    def shape(self, moment: int, times: Sequence[int]) -> GroundShape:
        """Return the way at ``times`` relative to the pose at ``moment``."""
        ends, table = self._ends[: max(1, self._last)], self._table[: max(1, self._last)]
        oldest = int(np.searchsorted(ends, min([moment, *times]) - SECOND))
        ends, table = ends[min(oldest, ends.size - 1) :], table[min(oldest, ends.size - 1) :]
        last = ends.size - 1
        here = int(np.minimum(np.searchsorted(ends, moment), last))
        there = np.minimum(np.searchsorted(ends, np.asarray(times, np.int64)), last)
        base, more = (_relative(table, bias, here, there) for bias in (0.0, BIAS_STEP))
        along, swing = table[:, _ALONG].cumsum(), table[:, _SWING].cumsum()
        turned = np.abs(swing[there] - swing[here])
        far = np.hypot(base[:, 0], base[:, 1])
        return GroundShape(
            base,
            (more - base) / BIAS_STEP,
            np.abs(along[there] - along[here]) + turned * far**2 / 3.0,
            turned,
            far,
        )


def _relative(table: Array, bias: float, here: int, there: NDArray[np.int64]) -> Array:
    """Return forward, right, turn from the end of one stretch to those of others, (times, 3)."""
    turns = table[:, _TURN] - bias * table[:, _DURATION]
    heading = turns.cumsum()
    middle = heading - 0.5 * turns
    north = (table[:, _DISTANCE] * np.cos(middle)).cumsum()
    east = (table[:, _DISTANCE] * np.sin(middle)).cumsum()
    sine, cosine = math.sin(heading[here]), math.cos(heading[here])
    north, east = north[there] - north[here], east[there] - east[here]
    forward, right = north * cosine + east * sine, east * cosine - north * sine
    return np.stack([forward, right, heading[there] - heading[here]], axis=1)


class GroundShape(NamedTuple):
    """See :class:`Shape`; ``base`` is forward, right, turn at each time (times, 3), ``slope`` its slope by the bias."""

    base: Array
    slope: Array
    variance: Array
    turn_variance: Array
    reach: Array

    def poses(self, columns: Mapping[str, Array]) -> Poses:
        """Return the poses at the times."""
        bias, scale = columns[GYRO_BIAS], columns[ODOMETRY_SCALE]
        heading = columns["heading"]
        cosine, sine = scale * np.cos(heading), scale * np.sin(heading)
        forward = self.base[:, :1] + self.slope[:, :1] * bias
        right = self.base[:, 1:2] + self.slope[:, 1:2] * bias
        return Poses(
            columns["north"] + forward * cosine - right * sine,
            columns["east"] + forward * sine + right * cosine,
            heading + self.base[:, 2:] + self.slope[:, 2:] * bias,
        )


class FreeWay:
    """The way of which nothing is known but that a velocity lasts.

    Parameters
    ----------
    configuration : Configuration
        How fast, and how much the velocity changes.
    """

    def __init__(self, configuration: Configuration) -> None:
        sigma = configuration.motion.velocity_sigma
        self._noise = configuration.motion.acceleration_noise
        self.unknowns: Unknowns = {_NORTH: (0.0, sigma), _EAST: (0.0, sigma)}

    def moved(self, start: int, end: int) -> None:
        """Forget it: there is nothing to know."""

    def shape(self, moment: int, times: Sequence[int]) -> FreeShape:
        """Return the way at ``times`` relative to the place at ``moment``."""
        after = (np.asarray(times, np.int64) - moment) / SECOND
        age = np.abs(after)
        sigma = self.unknowns[_NORTH][1]
        return FreeShape(after[:, None], self._noise**2 * age**3 / 3.0, np.zeros(age.size), 2.0 * sigma * age)


class FreeShape(NamedTuple):
    """See :class:`Shape`; ``after`` is the seconds from the moment to each time, (times, 1)."""

    after: Array
    variance: Array
    turn_variance: Array
    reach: Array

    def poses(self, columns: Mapping[str, Array]) -> Poses:
        """Return the poses at the times."""
        heading = np.broadcast_to(columns["heading"], (len(self.after), columns["heading"].size))
        return Poses(
            columns["north"] + self.after * columns[_NORTH],
            columns["east"] + self.after * columns[_EAST],
            heading,
        )


def way_of(vehicle: Vehicle, configuration: Configuration, seconds: float) -> Way:
    """Return the way that fits ``vehicle``, remembered for so many seconds."""
    if isinstance(vehicle, GroundVehicle):
        return GroundWay(vehicle, configuration, seconds)
    assert isinstance(vehicle, FreeVehicle), f"no way for {type(vehicle).__name__}"
    return FreeWay(configuration)
