"""When the ticks are due: absolute deadlines, so that no lateness adds up."""

from __future__ import annotations

from drivers.sample import SECOND


class Schedule:
    """Deadline of tick k: ``start + k / rate``, on one clock in nanoseconds.

    A tick that comes late is done late; when later ones have come due meanwhile, only the last of them is
    done and the others are counted as missed. Ticks are never made up for in a burst.

    Parameters
    ----------
    rate : float
        Ticks per second.
    start_ns : int
        When tick 0 is due.
    """

    def __init__(self, rate: float, start_ns: int) -> None:
        if rate <= 0.0:
            raise ValueError(f"the rate must be more than 0 ticks per second, got {rate}")
        self._rate = rate
        self._start_ns = start_ns
        self._tick = 0
        self.missed = 0
        """Ticks that were never done because an earlier one took too long."""
        self.rested = 0
        """Ticks that were left out on purpose."""

    @property
    def tick(self) -> int:
        """Number of the tick to do next, counted in periods from the start."""
        return self._tick

    @property
    def deadline_ns(self) -> int:
        """When the tick to do next is due."""
        return self._start_ns + round(self._tick * SECOND / self._rate)

    def advance(self, now_ns: int) -> None:
        """Go on to the tick after this one, or to the last that is due already."""
        due = int((now_ns - self._start_ns) * self._rate / SECOND)
        following = max(self._tick + 1, due)
        self.missed += following - self._tick - 1
        self._tick = following

    def rest(self, ticks: int) -> None:
        """Leave out the ticks that come next."""
        self._tick += ticks
        self.rested += ticks
