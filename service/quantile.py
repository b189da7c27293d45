"""The running high quantile: of the last few values, the one that all but a given share do not exceed.

Exact over a sliding window kept in order, rather than an approximation over all time (P², stochastic
approximation): a cost that doubles must show within a handful of ticks, and one that halves must be forgotten
as surely. With 64 values one insertion costs about a microsecond.
"""

from __future__ import annotations

import math
from bisect import bisect_left, insort
from collections import deque


class RunningQuantile:
    """Quantile of the last values: the smallest that at least a share ``probability`` of them do not exceed.

    Parameters
    ----------
    window : int
        How many values it remembers, at least 1.
    probability : float
        In (0, 1].

    Raises
    ------
    ValueError
        Either is out of its range.
    """

    def __init__(self, window: int, probability: float) -> None:
        if window < 1 or not 0.0 < probability <= 1.0:
            raise ValueError(
                f"a quantile needs window >= 1 and 0 < probability <= 1, got {window} and {probability}"
            )
        self._window = window
        self._probability = probability
        self._arrived: deque[float] = deque()
        self._ordered: list[float] = []

    def __len__(self) -> int:
        return len(self._ordered)

    def add(self, value: float) -> None:
        """Take one more value in, and forget the oldest when the window is full."""
        if len(self._arrived) == self._window:
            del self._ordered[bisect_left(self._ordered, self._arrived.popleft())]
        self._arrived.append(value)
        insort(self._ordered, value)

    def scale(self, factor: float) -> None:
        """Multiply every remembered value by a positive factor."""
        self._arrived = deque(factor * value for value in self._arrived)
        self._ordered = [factor * value for value in self._ordered]

    @property
    def value(self) -> float:
        """The quantile; 0.0 while nothing has been added."""
        if not self._ordered:
            return 0.0
        return self._ordered[math.ceil(self._probability * len(self._ordered)) - 1]
