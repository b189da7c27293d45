"""A course that a receiver holds: near standstill it has none, and says the last one that it had again and again.

Satellite receivers measure the velocity by Doppler and report it as speed and course. Below some speed (0.1 to 1 m/s,
by the receiver's settings) they freeze the course, while the speed goes on to scatter. Taken for a velocity that
drifts the belief off one way for as long as the vehicle hovers. A course that is measured scatters in its last digits.
"""

from __future__ import annotations

import math

SAME = 1e-7
"""Radians: a course that is nearer to the one before is the same, to the rounding of the arithmetic."""

FAST = 2.0
"""m/s from which on every receiver measures its course: then one that repeats is a coincidence."""


class HeldCourse:
    """What one receiver said last."""

    def __init__(self) -> None:
        self._course: float | None = None

    def holds(self, north: float, east: float) -> bool:
        """Hear a velocity, m/s, and say whether its course is the one before, held."""
        before, self._course = self._course, math.atan2(east, north)
        if before is None or math.hypot(north, east) >= FAST:
            return False
        return abs(math.remainder(self._course - before, math.tau)) < SAME
