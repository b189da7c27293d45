"""The reset counter: steps once for each jump of the published position that is not motion.

A jump is either done on purpose (the belief begins anew where a search, an order or a witness says; another hypothesis
leads) or seen in what is published: within about a second the position has moved by more than :data:`FAR` beyond what
its own velocity says, as when a receiver is back after minutes of dead reckoning. While it tracks it may go as far as
it said, within that second, that it may be off: that is what a fix is for. Of a vehicle whose way nobody measures that
holds between two fixes, too: it goes where it is not seen, and a fix within the region that was claimed tells its
motion. What moves in the wake of a jump belongs to it. A belief that had no place yet, or lost it, does not jump when
it finds one; one that was told its start, and reckoned on from there, does.
"""

from __future__ import annotations

import math

from drivers.sample import SECOND
from service.estimate import Estimate, HealthState

FAR = 5.0
"""Metres."""

WAKE = 2 * SECOND
"""Nanoseconds."""

FADING = 1.0
"""Seconds in which an unexplained move is forgotten."""

PLACED = 10.0
"""Metres of ``radius95`` that are a place."""

_NO_PLACE = (HealthState.WAITING, HealthState.LOST)

TRACKS = frozenset({HealthState.TRACKING})
UNSEEN = frozenset({HealthState.TRACKING, HealthState.DEAD_RECKONING, HealthState.CONVERGING})
"""Healths in which a position may go as far as was claimed: its way measured, or not."""


class Jumps:
    """Counts jumps.

    Parameters
    ----------
    excused : frozenset of HealthState
        Healths in which the position may go as far as was claimed.

    Attributes
    ----------
    steps : int
        The reset counter.
    """

    def __init__(self, excused: frozenset[HealthState] = TRACKS) -> None:
        self.steps = 0
        self._excused = excused
        self._claimed = 0.0
        self._placed = False
        self._switches = 0
        self._last = -(2**62)
        self._before: Estimate | None = None
        self._north = self._east = 0.0
        self._untracked = -(2**62)

    def done(self, now: int) -> None:
        """Count a jump that was done on purpose at ``now`` (nanoseconds): what was before is of another belief."""
        self._step(now)
        self._before, self._placed = None, False

    def led(self, now: int, switches: int) -> None:
        """Hear how often the leading hypothesis has changed so far."""
        if switches > self._switches and now - self._last > WAKE:
            self._step(now)
        self._switches = switches

    def spoken(self, estimate: Estimate) -> None:
        """See what is published, and count a jump in it for the next estimate to tell."""
        before, self._before = self._before, estimate
        offset = None if before is None or not self._had_place(before) else _offset(before, estimate)
        if before is None or offset is None:
            self._north = self._east = self._claimed = 0.0
            return
        kept = math.exp(-(estimate.monotonic_ns - before.monotonic_ns) / SECOND / FADING)
        self._north = kept * self._north + offset[0]
        self._east = kept * self._east + offset[1]
        self._claimed = max(kept * self._claimed, before.radius95 or 0.0)
        if before.health not in self._excused:
            self._untracked = before.monotonic_ns
        excused = before.monotonic_ns - self._untracked > WAKE
        limit = max(FAR, self._claimed) if excused else FAR
        if math.hypot(self._north, self._east) > limit:
            if estimate.monotonic_ns - self._last > WAKE:
                self._step(estimate.monotonic_ns)
            self._north = self._east = 0.0

    def _had_place(self, estimate: Estimate) -> bool:
        """Say whether what moves from here on may jump; of a belief that converges, whether it had a place before."""
        if estimate.health in _NO_PLACE:
            self._placed = False
        elif estimate.health is not HealthState.CONVERGING and (estimate.radius95 or 0.0) <= PLACED:
            self._placed = True
        if estimate.health is HealthState.CONVERGING:
            return self._placed
        return estimate.health is not HealthState.WAITING

    def _step(self, now: int) -> None:
        self.steps += 1
        self._last = now


def _offset(before: Estimate, after: Estimate) -> tuple[float, float] | None:
    """Return how far the position moved beyond what the velocity before says, north and east, metres."""
    (n0, e0, _), (n1, e1, _) = before.position, after.position
    if n0 is None or e0 is None or n1 is None or e1 is None:
        return None
    seconds = (after.monotonic_ns - before.monotonic_ns) / SECOND
    vn, ve, _ = before.velocity
    return n1 - n0 - seconds * (vn or 0.0), e1 - e0 - seconds * (ve or 0.0)
