"""The receive clock of a log whose stamps may be damaged, and whose clock may have been set."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable, Iterator
from itertools import islice
from typing import TypeVar

MICROSECOND = 1_000  # ns
LONGEST_GAP = 60_000_000  # µs: further on, the next stamp decides whether this one is damaged
LARGEST_STAMP = 2**63 // 1_000 - 1  # µs: beyond it nanoseconds fit no 64 bits; the year 2262
OUT_OF_ORDER = 1_000_000  # µs: so little back is two writers of one log, not a clock that was set


class ReceiveClock:
    """The log's receive clock, kept from running back.

    A stamp out of line whose successor is in line again is damaged: the last one is used, as for one that is
    only a little behind. A longer step back that lasts (the clock was set) is taken out: time goes on from
    there.

    Parameters
    ----------
    stamps : list[int]
        The first stamps of the log, microseconds, at best three: if one is damaged, the others overrule it.
    """

    def __init__(self, stamps: list[int]) -> None:
        self.faults: Counter[str] = Counter()
        self._shift = 0
        middle = sorted(stamps)[len(stamps) // 2]
        self._last = min(stamp for stamp in stamps if abs(stamp - middle) <= LONGEST_GAP)

    def read(self, stamp: int, following: int | None) -> int:
        """Return the time of arrival in nanoseconds; ``following`` is the log's next stamp, if any."""
        time = stamp + self._shift
        if not 0 <= time - self._last <= LONGEST_GAP:
            time = self._judge(time, following)
        self._last = time
        return time * MICROSECOND

    def _judge(self, time: int, following: int | None) -> int:
        last = self._last
        if 0 < last - time <= OUT_OF_ORDER:
            return last
        if following is not None and 0 <= following + self._shift - last <= LONGEST_GAP:
            self.faults["bad_stamp"] += 1
            return last
        if time > last:
            return time
        self.faults["clock_step"] += 1
        self._shift += last - time
        return last


Entry = TypeVar("Entry")


def on_clock(entries: Iterable[tuple[int, Entry]], faults: Counter[str]) -> Iterator[tuple[int, Entry]]:
    """Yield the entries of a log with their times (ns, never running back) in place of their stamps (µs).

    Parameters
    ----------
    entries : Iterable of (stamp, entry)
        In the order of the log; at most three are read ahead.
    faults : Counter[str]
        Counts ``bad_stamp`` and ``clock_step``.
    """
    source = iter(entries)
    ahead = deque(islice(source, 3))
    if not ahead:
        return
    clock = ReceiveClock([stamp for stamp, _ in ahead])
    clock.faults = faults
    for following in source:
        stamp, entry = ahead.popleft()
        ahead.append(following)
        yield clock.read(stamp, ahead[0][0]), entry
    while ahead:
        stamp, entry = ahead.popleft()
        yield clock.read(stamp, ahead[0][0] if ahead else None), entry
