"""When a frame arrived: from the wall clock on which the kernel stamps it to the host's monotonic clock."""

from __future__ import annotations

import time

_SLACK_NS = 1_000_000


class ArrivalClock:
    """Maps a frame's Unix stamp to monotonic nanoseconds, whatever happens to the wall clock.

    The age of a frame is the wall clock's reading minus its stamp. It cannot be negative, nor reach back
    beyond the moment when the queue was last seen empty. A stamp that claims either was overtaken by a step
    of the wall clock, or is none (some adapters count from their own start): then the frame arrives when it
    is read.
    """

    def __init__(self) -> None:
        self._empty_ns = time.monotonic_ns()

    def seen_empty(self, at_ns: int) -> None:
        """Note that no frame was waiting at ``at_ns`` (monotonic)."""
        self._empty_ns = at_ns

    def arrival(self, stamp: float, now_ns: int, unix_now: float) -> int:
        """Return when a frame arrived.

        Parameters
        ----------
        stamp : float
            Unix seconds, as the interface says.
        now_ns : int
            The monotonic clock, nanoseconds, at the reading of the frame.
        unix_now : float
            The wall clock, seconds, at the same moment.

        Returns
        -------
        int
            Monotonic nanoseconds, never after ``now_ns``.
        """
        arrived = now_ns - int((unix_now - stamp) * 1e9)
        if self._empty_ns - _SLACK_NS <= arrived <= now_ns + _SLACK_NS:
            return min(max(arrived, self._empty_ns), now_ns)
        return now_ns
