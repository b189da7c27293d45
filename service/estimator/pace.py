"""How fast a vehicle may be moving while nothing is heard of its motion: no faster than it has ever been seen to be.

A stretch without odometry widens the belief by a speed that nobody knows. For a vehicle that has hardly moved yet that
is one for all: :data:`UNKNOWN_SPEED`. One that has shown how it moves, for :data:`SHOWN` seconds, is not expected to
outrun itself: a robot that creeps about a room at 0.1 m/s is not metres away after a second of silence.
"""

from __future__ import annotations

UNKNOWN_SPEED = 2.0
"""m/s; how fast a vehicle may move while its odometry is silent (one standard deviation)."""

UNKNOWN_YAW_RATE = 0.5
"""rad/s; the same for a silent gyro."""

SHOWN = 30.0
"""Seconds of movement after which a vehicle has shown how fast it is."""

RESTING = 0.01
"""m/s or rad/s up to which a vehicle does not show how it moves: it stands."""


class Pace:
    """The fastest that one kind of motion has been.

    Parameters
    ----------
    unknown : float
        One standard deviation while that is not known, m/s or rad/s, and never more.
    """

    def __init__(self, unknown: float) -> None:
        self._unknown = unknown
        self._fastest = 0.0
        self._moved = 0.0

    def saw(self, rate: float, duration: float) -> None:
        """Take a rate (m/s or rad/s) that the vehicle moved with for so many seconds."""
        rate = abs(rate)
        if rate > RESTING:
            self._moved += duration
            self._fastest = max(self._fastest, rate)

    @property
    def sigma(self) -> float:
        """How fast it may be while nothing is heard: one standard deviation, m/s or rad/s."""
        return self._unknown if self._moved < SHOWN else min(self._unknown, self._fastest)
