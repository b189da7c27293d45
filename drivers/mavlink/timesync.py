"""TIMESYNC (111): asking the peer what its clock says, and answering when it asks.

A request carries our clock in ``ts1`` and 0 in ``tc1``; the answer carries the peer's clock in ``tc1`` and
our ``ts1`` back. All are nanoseconds; ours is the host's monotonic clock.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from drivers.clock import DeviceClocks
from drivers.sample import SECOND

QUICK = SECOND // 10
SLOW = SECOND
PATIENCE = 50  # unanswered quick requests, after which the peer is asked slowly
OUTSTANDING = 64


class TimeSync(NamedTuple):
    """The two fields of the message, nanoseconds."""

    tc1: int
    ts1: int

    @property
    def asks(self) -> bool:
        """Whether it is a request."""
        return self.tc1 == 0

    def answer(self, now: int) -> TimeSync:
        """Return what to answer to a request when our clock reads ``now``."""
        return TimeSync(now, self.ts1)


class TimeSynchroniser:
    """Decides when to ask, and feeds what is answered into the clocks of the peer.

    Attributes
    ----------
    answered, unasked : int
        Exchanges completed; answers to no request of ours (some one else's, or one that is long over).
    """

    def __init__(self) -> None:
        self.answered = 0
        self.unasked = 0
        self._asked: deque[int] = deque(maxlen=OUTSTANDING)
        self._unanswered = 0
        self._next = 0

    def request(self, now: int, clocks: DeviceClocks) -> TimeSync | None:
        """Return the request to send if one is due: ten a second until the clock is known, then one."""
        if now < self._next:
            return None
        known = "timesync" in (clocks.boot.method, clocks.unix.method)
        self._next = now + (SLOW if known or self._unanswered >= PATIENCE else QUICK)
        self._asked.append(now)
        self._unanswered += 1
        return TimeSync(0, now)

    def answered_by(self, answer: TimeSync, received: int, clocks: DeviceClocks) -> None:
        """Take in an answer that arrived at ``received`` (ns), for the clocks of whoever sent it."""
        if answer.ts1 not in self._asked:
            self.unasked += 1
            return
        self._asked.remove(answer.ts1)
        self.answered += 1
        self._unanswered = 0
        clocks.exchanged(answer.ts1, answer.tc1, received)
