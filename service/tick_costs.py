"""What the last ticks would have cost at any count: the governor's memory.

Each tick is kept as lines over the count: what the rest of it cost, and what each of its measurements did. From them
comes, for the room that the next tick has, the count that would have filled each of them, and the low quantile of
these counts is what is afforded. So stages that peak in different ticks are not added up as if they peaked in one, as
a sum of the stages' own quantiles does: with many stages of which each comes in bursts, that sum is twice what
forty-nine ticks of fifty cost.

Everything is allocated once.
"""

from __future__ import annotations

from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

WINDOW = 100
PROBABILITY = 0.98

EXPECTED = 50
"""Ticks that are remembered before the first one: one early exception does not rule. The first ticks replace them."""

_LEAST = 1e-15
"""Seconds: where something costs nothing, it is divided by this."""


class Line(NamedTuple):
    """Seconds, and seconds per particle: what something costs at any count."""

    constant: float
    slope: float

    def plus(self, other: Line) -> Line:
        """Return the cost of both."""
        return Line(self.constant + other.constant, self.slope + other.slope)

    def times(self, factor: float) -> Line:
        """Return a multiple of the cost."""
        return Line(factor * self.constant, factor * self.slope)

    def at(self, count: int) -> float:
        """Return the cost at ``count`` particles, seconds."""
        return self.constant + self.slope * count

    def split(self, seconds: float, count: int) -> Line:
        """Divide what was measured at ``count`` particles into a constant and a slope, in this line's proportion."""
        return self.times(seconds / self.at(count))


FREE = Line(0.0, 0.0)


class TickCosts:
    """The costs of the last ticks, at any count.

    Parameters
    ----------
    rest : Line
        What a tick is expected to cost beside its measurements.
    each : Line
        What each of its measurements is expected to cost.
    measurements : float
        How many of them are expected.
    """

    def __init__(self, rest: Line, each: Line, measurements: float) -> None:
        # rows: rest and its slope, each and its slope, measurements
        self._lines: NDArray[np.float64] = np.zeros((5, WINDOW))
        self._lines[:, :EXPECTED] = np.array([*rest, *each, measurements])[:, np.newaxis]
        self._result: NDArray[np.float64] = np.zeros(WINDOW)
        self._scratch: NDArray[np.float64] = np.zeros(WINDOW)
        self._next = 0
        self._held = EXPECTED

    def add(self, rest: Line, each: Line, measurements: int) -> None:
        """Remember one more tick, in the place of the oldest, or of one that was only expected."""
        self._lines[:, self._next] = (*rest, *each, measurements)
        self._next = (self._next + 1) % WINDOW
        self._held = max(self._held, self._next or WINDOW)

    def fade(self, factor: float) -> None:
        """Multiply every remembered cost by a factor."""
        self._lines[:4] *= factor

    def at(self, count: int) -> float:
        """Return the high quantile of what the ticks would have cost at ``count`` particles, seconds."""
        rest, rest_slope, each, each_slope, measurements = self._lines[:, : self._held]
        cost, scratch = self._result[: self._held], self._scratch[: self._held]
        np.multiply(each_slope, count, out=cost)
        cost += each
        cost *= measurements
        np.multiply(rest_slope, count, out=scratch)
        cost += scratch
        cost += rest
        cost.sort()
        return float(cost[self._rank])

    def particles(self, room: float) -> float:
        """Return how many particles nearly every tick could have had in ``room`` seconds, all weighed; not below 0."""
        rest, rest_slope, each, each_slope, measurements = self._lines[:, : self._held]
        left, cost = self._result[: self._held], self._scratch[: self._held]
        np.multiply(each, measurements, out=left)
        left += rest
        np.subtract(room, left, out=left)
        np.multiply(each_slope, measurements, out=cost)
        cost += rest_slope
        return self._low_quotient()

    def measurements(self, room: float, count: int) -> float:
        """Return how many measurements nearly every tick could have weighed with ``count`` particles; not below 0."""
        rest, rest_slope, each, each_slope, _ = self._lines[:, : self._held]
        left, cost = self._result[: self._held], self._scratch[: self._held]
        np.multiply(rest_slope, count, out=left)
        left += rest
        np.subtract(room, left, out=left)
        np.multiply(each_slope, count, out=cost)
        cost += each
        return self._low_quotient()

    def _low_quotient(self) -> float:
        """Return the low quantile of what is left divided by what one costs."""
        quotients, divisor = self._result[: self._held], self._scratch[: self._held]
        np.maximum(divisor, _LEAST, out=divisor)
        quotients /= divisor
        quotients.sort()
        return max(0.0, float(quotients[self._held - 1 - self._rank]))

    @property
    def _rank(self) -> int:
        return ceil(PROBABILITY * self._held) - 1
