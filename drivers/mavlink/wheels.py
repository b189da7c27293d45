"""Wheels: WHEEL_DISTANCE as totals with epochs, RPM as angular speeds."""

from __future__ import annotations

import math
from typing import Any

from drivers.mavlink.moment import Moment, Timed
from drivers.sample import MotorSpeed, Odometer

RPM = math.tau / 60.0
NO_SENSOR = -1.0
LARGEST_COUNT = 16
OUT_OF_ORDER_US = 1_000_000
FASTEST = 100.0  # m/s: a wheel that seems to roll faster has started its count anew
SLACK = 1.0  # m, for stamps that are coarse


class Odometry:
    """WHEEL_DISTANCE 9000 of one controller: cumulative metres per wheel, from zero at every boot."""

    def __init__(self) -> None:
        self._last: tuple[int, int, tuple[float, ...]] | None = None  # stamp, received, distances
        self._epoch = 0

    def __call__(self, fields: Any, at: Moment) -> list[Timed]:
        """Return the totals; ``epoch`` steps when the count has started anew."""
        count: int = fields.count
        if not 1 <= count <= LARGEST_COUNT:
            at.refuse("count")
            return []
        distances: tuple[float, ...] = tuple(fields.distance[:count])
        if not all(map(math.isfinite, distances)):
            at.refuse("distance")
            return []
        if self._still(fields.time_usec, distances):
            return [(at.received, Odometer(distances, self._epoch))]
        if self._stale(fields.time_usec):
            at.pass_over("time_usec")
            return []
        self._epoch += self._started_anew(fields.time_usec, at.received, distances)
        self._last = (fields.time_usec, at.received, distances)
        return [(at.microseconds(fields.time_usec), Odometer(distances, self._epoch))]

    def _still(self, stamp: int, distances: tuple[float, ...]) -> bool:
        """Whether nothing has rolled: some encoders stamp the last edge, and stamp no more while they stand."""
        return self._last is not None and (stamp, distances) == (self._last[0], self._last[2])

    def _stale(self, stamp: int) -> bool:
        """Whether the message repeats the last one, or was overtaken on the way."""
        return self._last is not None and stamp != 0 and 0 <= self._last[0] - stamp < OUT_OF_ORDER_US

    def _started_anew(self, stamp: int, received: int, distances: tuple[float, ...]) -> bool:
        if self._last is None:
            return False
        last_stamp, last_received, last = self._last
        if len(last) != len(distances) or (stamp and stamp < last_stamp):
            return True
        passed = (stamp - last_stamp) * 1e-6 if stamp and last_stamp else (received - last_received) * 1e-9
        reach = FASTEST * max(0.0, passed) + SLACK
        return any(abs(new - old) > reach for new, old in zip(distances, last, strict=True))


class Tachometers:
    """RPM 226: two sensors, -1 where there is none.

    ArduPilot also sends 0 for one that is not fitted, so a zero is believed only of a sensor that has turned.
    """

    def __init__(self) -> None:
        self._turned = [False, False]

    def __call__(self, fields: Any, at: Moment) -> list[Timed]:
        """Return the angular speeds of the sensors that exist; the message has no stamp."""
        readings: list[Timed] = []
        for index, (name, rpm) in enumerate((("rpm1", fields.rpm1), ("rpm2", fields.rpm2))):
            if rpm == NO_SENSOR:
                continue
            if not math.isfinite(rpm):
                at.refuse(name)
                continue
            self._turned[index] |= rpm != 0.0
            if self._turned[index]:
                readings.append((at.received, MotorSpeed(index, rpm * RPM)))
            else:
                at.pass_over(name)
        return readings
