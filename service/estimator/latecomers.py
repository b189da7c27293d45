"""Measurements that the horizon has long passed: fused by where every particle's path was when they were made.

They wait here, bounded in number, and each tick takes as many as its particles leave time for. What is older than the
paths reach back, or finds no room, is refused as late. The paths are marked as the belief goes on
(:class:`filters.paths.Paths`).
"""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np

from drivers.sample import SECOND
from filters.belief import Displacement, Evidence
from filters.motion.unicycle import GYRO_BIAS, ODOMETRY_SCALE
from filters.particle import ParticleFilter
from filters.paths import Past, Paths
from service.config import Configuration
from service.estimator.ground import GroundVehicle
from service.estimator.intake import Waiting
from service.estimator.measuring import Measurement
from service.estimator.vehicle import Vehicle

MEMORY = 12_000_000
"""Bytes for the marks: many of few particles, or few of many."""

MOST_MARKS = 40
BYTES = 16
"""Of a particle at a mark: its pose, and who its ancestor was."""

MOST_WAITING = 4096
WORK = 40_000
"""Particles times measurements that a tick takes the time for: about 1.5 ms on a companion computer."""


class Latecomers:
    """The late measurements of one belief.

    Parameters
    ----------
    vehicle : GroundVehicle
        Whose controls tell the way between two marks.
    belief : ParticleFilter
        Whose paths are kept.
    stretch : int
        Nanoseconds by which a measurement may be late.
    """

    def __init__(self, vehicle: GroundVehicle, belief: ParticleFilter[Any], stretch: int) -> None:
        marks = max(2, min(MOST_MARKS, MEMORY // (BYTES * belief.capacity)))
        self._vehicle = vehicle
        self._belief = belief
        self._stretch = stretch
        self._spacing = max(SECOND, -(-stretch // (marks - 1)))
        self._paths = Paths(belief, marks)
        self._waiting: deque[tuple[int, Waiting]] = deque(maxlen=MOST_WAITING)

    @property
    def stretch(self) -> int:
        """Nanoseconds by which a measurement may be late."""
        return self._stretch

    def take(self, time: int, waiting: Waiting) -> bool:
        """Have a late measurement wait; ``False`` if it is too late, or too many wait already."""
        earliest = self._paths.earliest
        if earliest is None or time < earliest or len(self._waiting) == MOST_WAITING:
            return False
        self._waiting.append((time, waiting))
        return True

    def due(self) -> list[tuple[int, Waiting]]:
        """Return those that this tick has time for, first come first."""
        room = WORK // max(1, self._belief.count)
        return [self._waiting.popleft() for _ in range(min(room, len(self._waiting)))]

    def weigh(self, time: int, now: int, measured: Measurement) -> Evidence | None:
        """Weigh the belief, whose time is ``now``, by a measurement of ``time``; ``None`` if no path is as old."""
        past = self._past(time, now)
        return None if past is None else self._belief.weigh_past(measured.model, measured.value, *past)

    def keep(self, now: int) -> None:
        """Mark the paths, if the last mark is long enough ago; ``now`` is the belief's time."""
        latest = self._paths.latest
        if latest is None or now - latest >= self._spacing:
            self._paths.mark(now)

    def _past(self, time: int, now: int) -> Past | None:
        column = self._belief.column
        biases = (float(np.mean(column(GYRO_BIAS))), float(np.mean(column(ODOMETRY_SCALE))))

        def way(start: int, end: int) -> Displacement:
            return self._vehicle.displacement(start, end, biases)

        return self._paths.at(time, now, way)

    # --- as a companion -----------------------------------------------------------------------------------------

    def started(self, time: int) -> None:
        """Forget the paths: the particles were drawn anew."""
        self._paths.begin()

    def moved(self, start: int, end: int) -> None:
        """Nothing: paths are marked once a tick at most."""

    def weighed(self, time: int, measured: Measurement, evidence: Evidence, outlier: bool) -> None:
        """Nothing: weights are the belief's."""


def latecomers_of(
    configuration: Configuration, vehicle: Vehicle, belief: ParticleFilter[Any]
) -> Latecomers | None:
    """Return who takes late measurements; ``None`` where they are not wanted, or no controls tell the way."""
    stretch = round(configuration.loop.late_s * SECOND)
    if stretch == 0 or not isinstance(vehicle, GroundVehicle):
        return None
    return Latecomers(vehicle, belief, stretch)
