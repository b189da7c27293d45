"""Measurements in the order in which they were made, held back until the horizon passes them.

Sensors are late by different amounts; a filter must take them in the order of the world. Every measurement waits here
until the delayed horizon (``now - horizon``) reaches its time. What arrives later than that is refused and counted;
so is what claims to be from the future, and what would make the queue grow without bound.
"""

from __future__ import annotations

import heapq
from collections import Counter
from typing import Generic, TypeVar

Item = TypeVar("Item")

FUTURE_TOLERANCE = 50_000_000
"""A time this many nanoseconds ahead of now is a clock mapping that settles; more is a wrong clock."""

CAPACITY = 8192
"""Measurements that may wait at once: two thousand a second for four seconds."""


class Timeline(Generic[Item]):
    """A bounded priority queue of items with a moving horizon.

    Parameters
    ----------
    capacity : int
        How many items may wait; beyond that the newest comer is refused (counted as ``overflow``).

    Attributes
    ----------
    horizon : int
        Nanoseconds; everything up to here has been released.
    refused : Counter[str]
        How many items were not taken, by reason: ``late``, ``future``, ``overflow``.
    """

    def __init__(self, capacity: int = CAPACITY) -> None:
        self.capacity = capacity
        self.horizon = -(2**62)
        self.refused: Counter[str] = Counter()
        self._waiting: list[tuple[int, int, Item]] = []
        self._arrivals = 0

    def __len__(self) -> int:
        return len(self._waiting)

    def insert(self, item: Item, time: int, now: int) -> str | None:
        """Queue ``item``, measured at ``time`` and received at ``now``; return why it was refused, or ``None``."""
        reason = self._reason_to_refuse(time, now)
        if reason is not None:
            self.refused[reason] += 1
            return reason
        self._arrivals += 1
        heapq.heappush(self._waiting, (time, self._arrivals, item))
        return None

    def _reason_to_refuse(self, time: int, now: int) -> str | None:
        if time <= self.horizon:
            return "late"
        if time > now + FUTURE_TOLERANCE:
            return "future"
        if len(self._waiting) >= self.capacity:
            return "overflow"
        return None

    def release(self, horizon: int) -> list[tuple[int, Item]]:
        """Move the horizon forward to ``horizon`` and return what it passed, oldest first; ties in arrival order."""
        self.horizon = max(self.horizon, horizon)
        passed: list[tuple[int, Item]] = []
        while self._waiting and self._waiting[0][0] <= self.horizon:
            time, _, item = heapq.heappop(self._waiting)
            passed.append((time, item))
        return passed
