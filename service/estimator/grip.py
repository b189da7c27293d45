"""Whether the wheels hold the ground: how their speed changes, beside how the accelerometer felt the vehicle change.

Wheels that begin to spin, or that grip again, change their speed within a moment while the vehicle goes on as it did.
The speed of a stretch, less what the forward specific force has added up to by its middle, is level but for noise as
long as they hold, and so is the median of five: counts that were stamped a moment late make a stretch or two slow or
fast, and the speed comes back. How large that noise is depends on the unit, on how it is mounted and on the ground, so
its scale is learned, as that of a Student's t of four degrees of freedom (Lange, Little and Taylor, "Robust statistical
modeling using the t distribution", JASA 84, 1989: the weights (v + 1) / (v + e²) make a few great errors count for
little), and with it the mean: an accelerometer that is mounted askew feels gravity.

Wheels that slip all the while change their speed by more than the vehicle does, in proportion. Nothing is said of
wheels that begin to slip gently while nobody accelerates, of a distance that no wheel counted, or where there is no
accelerometer.
"""

from __future__ import annotations

import math
from collections import deque
from statistics import median
from typing import NamedTuple, Protocol

from drivers.sample import SECOND
from service.estimator.track import Motion

DEGREES = 4.0
"""Of freedom: one error in 2,000 lies beyond ten scales."""

FIRST_SCALE, LEAST_SCALE = 0.1, 0.01
"""m/s: where learning begins, and below which no wheel is believed."""

ENOUGH, MEMORY = 30, 100
"""Steps of the median before anything is said, and over how many the scale is a mean."""

MEDIAN = 5
"""Stretches whose median is taken."""

STANDING = 0.05
"""m/s below which a vehicle stands: its wheels say nothing of the scale."""

MOST = 8.0
"""Nats that one stretch says at most."""


class Felt(Protocol):
    """What wheels and accelerometer say; see :class:`~service.estimator.controls.Controls`."""

    @property
    def counted(self) -> bool:
        """Whether the distance is what wheels have counted."""
        ...

    def distance(self, start: int, end: int) -> Motion:
        """Return metres rolled between two times."""
        ...

    def gained(self, start: int, end: int) -> Motion:
        """Return by how much the accelerometer says that the speed has changed between two times, m/s."""
        ...


class Said(NamedTuple):
    """How many times likelier a stretch is than of wheels that hold: where they begin or cease to slip, and within."""

    change: float
    slip: float


NOTHING = Said(1.0, 1.0)
"""Where nothing can be said."""

NEVER = Motion(0.0, 1.0)


class Grip:
    """Compares one stretch after the other.

    Parameters
    ----------
    felt : Felt
        What wheels and accelerometer say.
    slip : float
        By how much the speed of wheels changes that begin to slip, as a share of it: the scale of another such t.

    Attributes
    ----------
    scale, mean : float
        Of how far wheels and accelerometer differ, m/s.
    """

    def __init__(self, felt: Felt, slip: float) -> None:
        self._felt = felt
        self._slip = slip
        self._end = 0
        self._middle = 0
        self._gained = 0.0
        self._levels: deque[float] = deque(maxlen=MEDIAN + 1)
        self._heard = 0
        self.scale = FIRST_SCALE
        self.mean = 0.0

    def ask(self, start: int, end: int) -> Said:
        """Compare a stretch, nanoseconds, with those that were asked for before; :data:`NOTHING` if they are apart."""
        wheels = self._felt.distance(start, end)
        if start != self._end:
            self._levels.clear()
        if end <= start or wheels.unknown > 0.0 or not self._felt.counted:
            self._end = 0
            return NOTHING
        last, self._middle, self._end = self._middle, (start + end) // 2, end
        gained = self._felt.gained(last, self._middle) if self._levels else NEVER
        if gained.unknown > 0.0:
            self._levels.clear()
            self._gained = 0.0
        self._gained += gained.total
        speed = wheels.total * SECOND / (end - start)
        self._levels.append(speed - self._gained)
        if len(self._levels) <= MEDIAN or abs(speed) < STANDING:
            return NOTHING
        return self._compare(speed, gained.total)

    def _compare(self, speed: float, gained: float) -> Said:
        before, *same, now = self._levels
        step = median((*same, now)) - median((before, *same))
        error = step - self.mean
        said = NOTHING if self._heard < ENOUGH else Said(self._odds(error, speed), self._odds(error, gained))
        if step != 0.0:  # a median that stays says nothing of the noise
            self._learn(error)
        return said

    def _odds(self, error: float, speed: float) -> float:
        """Return how many times likelier an error is where it goes with a share of a speed."""
        wide = math.hypot(self.scale, self._slip * speed)
        return math.exp(min(MOST, _log_density(error, wide) - _log_density(error, self.scale)))

    def _learn(self, error: float) -> None:
        self._heard += 1
        share = 1.0 / min(MEMORY, self._heard + 4)
        square = error * error
        weight = (DEGREES + 1.0) / (DEGREES + square / self.scale**2)
        self.mean += share * min(1.0, weight) * error
        variance = self.scale**2 + share * (weight * square - self.scale**2)
        self.scale = max(LEAST_SCALE, math.sqrt(variance))


def _log_density(error: float, scale: float) -> float:
    """Return the log density of Student's t, up to a constant."""
    return -math.log(scale) - 0.5 * (DEGREES + 1.0) * math.log1p((error / scale) ** 2 / DEGREES)
