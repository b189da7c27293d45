"""Exponential back-off: how long to wait before the next attempt, and when trust is restored."""

from __future__ import annotations

FIRST = 0.1
LONGEST = 5.0
HEALTHY = 10.0


class BackOff:
    """Waits double from 0.1 s to 5 s with every failure, and start anew after 10 s of health."""

    def __init__(self) -> None:
        self._next = FIRST

    def failed(self, lived: float) -> float:
        """Return the seconds to wait after something failed that had been well for ``lived`` seconds."""
        if lived >= HEALTHY:
            self._next = FIRST
        delay = self._next
        self._next = min(2.0 * delay, LONGEST)
        return delay
