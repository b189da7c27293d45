"""Wheels of a car's bus as :class:`~drivers.sample.Odometer`: totals that wrap, and speeds rolled up to totals."""

from __future__ import annotations

from collections.abc import Sequence

from drivers.sample import SECOND, Odometer

LONGEST_GAP = SECOND // 2
"""Longer than this without a message, nobody knows how far a wheel has rolled."""
FASTEST = 100.0  # m/s: a counter that runs faster has started anew
SLACK = 1.0  # m, for counters that are coarse


class Counters:
    """Distance counters of one message: each starts anew when its bits are used up, and at a reset.

    Parameters
    ----------
    spans : Sequence[float]
        Metres after which each wheel's counter starts at its beginning again.
    """

    def __init__(self, spans: Sequence[float]) -> None:
        self._spans = tuple(spans)
        self._last: tuple[int, tuple[float, ...]] | None = None
        self._totals: tuple[float, ...] = (0.0,) * len(self._spans)
        self._epoch = 0

    def take(self, values: Sequence[float], at: int) -> Odometer:
        """Return the totals with what the counters (metres) show at ``at`` (nanoseconds)."""
        counts = tuple(values)
        if self._last is not None:
            before, last = self._last
            steps = [
                _wrapped(now - then, span) for now, then, span in zip(counts, last, self._spans, strict=True)
            ]
            reach = FASTEST * max(0, at - before) / SECOND + SLACK
            if any(abs(step) > reach for step in steps):
                self._epoch += 1
            else:
                self._totals = tuple(total + step for total, step in zip(self._totals, steps, strict=True))
        self._last = (at, counts)
        return Odometer(self._totals, self._epoch)


def _wrapped(step: float, span: float) -> float:
    """Return a counter's step, less the whole turns of it: the one nearest to none."""
    return step - span * round(step / span) if span > 0.0 else step


class Rolled:
    """Speeds of the wheels of one message, rolled up to distances (trapezoidally)."""

    def __init__(self, wheels: int) -> None:
        self._last: tuple[int, tuple[float, ...]] | None = None
        self._totals = (0.0,) * wheels
        self._epoch = 0

    def take(self, values: Sequence[float], at: int) -> Odometer:
        """Return the totals with the speeds (m/s) at ``at`` (nanoseconds)."""
        speeds = tuple(values)
        if self._last is not None:
            before, last = self._last
            elapsed = at - before
            if 0 <= elapsed <= LONGEST_GAP:
                half = 0.5 * elapsed / SECOND
                self._totals = tuple(
                    total + half * (now + then)
                    for total, now, then in zip(self._totals, speeds, last, strict=True)
                )
            else:
                self._epoch += 1
        self._last = (at, speeds)
        return Odometer(self._totals, self._epoch)
