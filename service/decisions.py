"""The decision log: what every tick of the loop was allowed, so that a replay can be allowed the same.

The particle count, the level and the place of a cut are the only things in a belief that depend on the machine and on
what else it did. The loop sends them, with the tick's time and how many samples it took from each link, as one small
datagram per tick; the recording process writes them to a CSV file or, with the samples, to an .mcap. A replay of the
same samples by them gives the same bytes.
"""

from __future__ import annotations

import csv
import struct
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from service.channels import Outlet
from service.records import DECIDED

if TYPE_CHECKING:
    from service.estimator import Course

COLUMNS = ("tick", "now_ns", "unix_ns", "afforded", "level", "cause", "most", "cut_after", "rested")
UNCUT = -1
_FIGURES = struct.Struct("<cQqqiiiiiI")  # a tag first
_COUNT = struct.Struct("<I")


class DecisionLogError(Exception):
    """A file that is no decision log, or one with a hole; the text says where."""


class Decided(msgspec.Struct, frozen=True):
    """One tick as it was allowed and as it went.

    Attributes
    ----------
    tick : int
        Counts from 0; a hole means that the recording could not follow.
    now, unix : int
        Nanoseconds on the monotonic and on the Unix clock.
    afforded, level, cause, most : int
        What it was allowed: particles, and the course.
    cut_after : int
        Measurements after which the weighing was ended; :data:`UNCUT` if it was not.
    rested : int
        Ticks left out before this one.
    taken : tuple[int, ...]
        Samples taken from each link, in the order of the configuration.
    """

    tick: int
    now: int
    unix: int
    afforded: int
    level: int
    cause: int
    most: int
    cut_after: int
    rested: int
    taken: tuple[int, ...]

    def course(self) -> Course:
        """Return the course that the tick took, for the estimator to take again.

        Raises
        ------
        ValueError
            There is no such level or cause.
        """
        from service.estimator import Cause, Course, Level  # the recording process has no use for its kernels

        again = Course(Level(self.level), Cause(self.cause), self.most)
        again.rested = self.rested
        if self.cut_after != UNCUT:
            again.overrunning = lambda: again.weighed >= self.cut_after
        return again


class DecisionSender:
    """The loop's end: one datagram per tick, packed into the same bytes each time.

    Parameters
    ----------
    outlet : Outlet
        Queue to the recording process; what it refuses is counted there.
    links : int
        How many links there are.
    """

    def __init__(self, outlet: Outlet, links: int) -> None:
        self._outlet = outlet
        self._datagram = bytearray(_FIGURES.size + _COUNT.size * links)

    @property
    def dropped(self) -> int:
        """Records for which the queue had no room: what they said is missing in the recording."""
        return self._outlet.dropped

    def send(
        self, tick: int, now: int, unix: int, afforded: int, course: Course, taken: Iterable[int]
    ) -> None:
        """Send what a tick was allowed, once it is done."""
        cut_after = course.weighed if course.cut else UNCUT
        _FIGURES.pack_into(
            self._datagram, 0, DECIDED, tick, now, unix, afforded, course.level, course.cause, course.most, cut_after,
            course.rested,
        )  # fmt: skip
        for index, count in enumerate(taken):
            _COUNT.pack_into(self._datagram, _FIGURES.size + _COUNT.size * index, count)
        self._outlet.send(self._datagram)


def decided(datagram: bytes) -> Decided:
    """Return what a datagram of a :class:`DecisionSender` says."""
    taken = tuple(count for (count,) in _COUNT.iter_unpack(datagram[_FIGURES.size :]))
    _, tick, now, unix, afforded, level, cause, most, cut_after, rested = _FIGURES.unpack_from(datagram)
    return Decided(tick, now, unix, afforded, level, cause, most, cut_after, rested, taken)


def header(links: Sequence[str]) -> str:
    """Return the first line of a log: a column per link tells how many samples came from it."""
    return ",".join((*COLUMNS, *(f"taken {link}" for link in links))) + "\n"


def line(decision: Decided) -> str:
    """Return a tick as a line of the log."""
    *figures, taken = msgspec.structs.astuple(decision)
    return ",".join(map(str, (*figures, *taken))) + "\n"


class DecisionFile:
    """A decision log under construction, at the end of what is there.

    When the loop is started anew its ticks begin at 0 again, and the log gets a new head.

    Parameters
    ----------
    path : Path
        Of the file.
    links : Sequence[str]
        Names of the links, in the order of the configuration.
    """

    def __init__(self, path: Path, links: Sequence[str]) -> None:
        self._file = path.open("a", encoding="utf-8")
        self._head = header(links)
        self._headed = False

    def take(self, datagram: bytes) -> None:
        """Write a line, if the record is a decision."""
        if datagram[:1] != DECIDED:
            return
        decision = decided(datagram)
        head = "" if self._headed and decision.tick else self._head
        self._headed = True
        self._file.write(head + line(decision))

    def flush(self) -> None:
        """Hand what was written to the operating system."""
        self._file.flush()

    def close(self) -> None:
        """Write what is left, and close the file."""
        self._file.close()

    discard = close


def read(path: Path) -> list[Decided]:
    """Return the ticks of a log; of several runs (the loop was started anew) the last.

    A last line that breaks off is left out: the recording was ended there.

    Raises
    ------
    DecisionLogError
        It is no decision log, or a tick is missing.
    """
    found: list[Decided] = []
    text = path.read_text(encoding="utf-8", errors="replace")
    whole = text[: text.rfind("\n") + 1]
    rows = csv.reader(whole.splitlines())
    if tuple(next(rows, ())[: len(COLUMNS)]) != COLUMNS:
        raise DecisionLogError(
            f"{path}: not a decision log: its first line should begin with {','.join(COLUMNS)}"
        )
    for number, row in enumerate(rows, start=2):
        if row[:1] == [COLUMNS[0]]:
            found.clear()
        else:
            found.append(_parsed(f"{path}, line {number}", row, len(found)))
    return found


def _parsed(place: str, row: list[str], expected: int) -> Decided:
    try:
        figures = [int(cell) for cell in row]
        tick, now, unix, afforded, level, cause, most, cut_after, rested = figures[: len(COLUMNS)]
        decision = Decided(
            tick, now, unix, afforded, level, cause, most, cut_after, rested, tuple(figures[len(COLUMNS) :])
        )
        decision.course()
    except ValueError as error:
        raise DecisionLogError(f"{place}: {error}") from error
    if tick != expected:
        raise DecisionLogError(
            f"{place}: tick {tick}, expected {expected}: the recording could not follow, and what "
            "happened in between is not known"
        )
    return decision
