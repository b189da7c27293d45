"""PEAK's text recordings (.trc), versions 1.0 to 2.1, one message a line; gzipped ones, too.

``;$FILEVERSION`` says how the columns lie, from 2.0 on ``;$COLUMNS`` names them; ``;$STARTTIME`` is the start in
days since 1899-12-30, taken as UTC; without it (1.0) the clock starts at 0. Times are milliseconds since the start.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import BinaryIO, NamedTuple

from drivers.can import CanFrame
from drivers.can.frame import LARGEST_EXTENDED
from drivers.logs.canlog import LoggedFrame, Tally, lines

_MILLISECOND = 1_000_000
_DAY = 86_400
_UNIX_EPOCH = 25_569  # days from 1899-12-30 to 1970-01-01
_TIME = re.compile(rb"(?P<whole>\d{1,13})(?:\.(?P<fraction>\d{1,6}))?")
_DATA_TYPES = frozenset({b"DT", b"FD", b"FB", b"FE", b"BI"})
_FLEXIBLE = frozenset({b"FD", b"FB", b"FE", b"BI"})
_OTHER_TYPES = frozenset({b"RR", b"ST", b"ER", b"EC", b"EV"})
_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
_STANDARD_DIGITS = 4
_NO_FRAME = b"FFFFFFFF"
_DEFAULT_2 = "N,O,T,B,I,d,R,L,D"


class Line(NamedTuple):
    """One line: when it was (ns since the start), on which bus, its columns of identifier, length and data."""

    time: int
    channel: bytes
    identifier: bytes
    length: int
    data: list[bytes]
    flexible: bool = False


def _nanoseconds(text: bytes) -> int:
    match = _TIME.fullmatch(text)
    if match is None:
        raise ValueError("bad_line")
    return int(match["whole"]) * _MILLISECOND + int((match["fraction"] or b"0").ljust(6, b"0"))


def _number(columns: list[bytes], at: int) -> int:
    if not columns[at].isdigit() or len(columns[at]) > 3:
        raise ValueError("bad_line")
    return int(columns[at])


def _first(columns: list[bytes]) -> Line | None:
    """Version 1.0: number, time, identifier, length, data."""
    if columns[2] == _NO_FRAME or b"RTR" in columns:
        return None
    return Line(_nanoseconds(columns[1]), b"1", columns[2], _number(columns, 3), columns[4:])


def _typed(columns: list[bytes], kind: int) -> bool:
    """Whether a line of version 1.1 to 1.3 is a data frame, rather than a remote frame or the bus's state."""
    if columns[kind] not in (b"Rx", b"Tx", b"Warng", b"Error"):
        raise ValueError("bad_line")
    return columns[kind] in (b"Rx", b"Tx") and b"RTR" not in columns


def _second(columns: list[bytes]) -> Line | None:
    """Version 1.1: number, time, type, identifier, length, data."""
    if not _typed(columns, 2):
        return None
    return Line(_nanoseconds(columns[1]), b"1", columns[3], _number(columns, 4), columns[5:])


def _with_bus(columns: list[bytes]) -> Line | None:
    """Version 1.2: number, time, bus, type, identifier, length, data."""
    if not _typed(columns, 3):
        return None
    return Line(_nanoseconds(columns[1]), columns[2], columns[4], _number(columns, 5), columns[6:])


def _third(columns: list[bytes]) -> Line | None:
    """Version 1.3: number, time, bus, type, identifier, reserved, length, data."""
    if not _typed(columns, 3):
        return None
    return Line(_nanoseconds(columns[1]), columns[2], columns[4], _number(columns, 6), columns[7:])


def _named(order: str) -> Callable[[list[bytes]], Line | None]:
    """Version 2.0 and 2.1: columns by letter; D, the data, is the last and has many."""
    places = {letter: index for index, letter in enumerate(order.split(","))}

    def read(columns: list[bytes]) -> Line | None:
        kind = columns[places["T"]]
        if kind not in _DATA_TYPES:
            if kind not in _OTHER_TYPES:
                raise ValueError("bad_line")
            return None
        length = _number(columns, places["l"]) if "l" in places else _LENGTHS[_number(columns, places["L"])]
        bus = columns[places["B"]] if "B" in places else b"1"
        data = columns[places["D"] :] if "D" in places else []
        return Line(
            _nanoseconds(columns[places["O"]]), bus, columns[places["I"]], length, data, kind in _FLEXIBLE
        )

    return read


_READERS: dict[bytes, Callable[[list[bytes]], Line | None]] = {
    b"1.0": _first,
    b"1.1": _second,
    b"1.2": _with_bus,
    b"1.3": _third,
}


class _Head:
    """What the remarks at the top say: the version, the start, the columns."""

    def __init__(self) -> None:
        self.start = 0
        self.read: Callable[[list[bytes]], Line | None] = _first

    def take(self, remark: bytes, tally: Tally) -> None:
        """Take in one line that starts with a semicolon."""
        key, _, value = remark.partition(b"=")
        value = value.strip()
        if key == b";$FILEVERSION":
            self.read = _READERS.get(value, _named(_DEFAULT_2) if value[:2] == b"2." else _first)
        elif key == b";$STARTTIME":
            try:
                days = float(value)
                self.start = max(0, round((days - _UNIX_EPOCH) * _DAY * 1e6) * 1_000) if days < 2e5 else 0
            except (ValueError, OverflowError):
                tally.refused["bad_line"] += 1
        elif key == b";$COLUMNS":
            order = value.decode("latin-1")
            letters = order.split(",")
            if {"O", "T", "I"} <= set(letters) and {"l", "L"} & set(letters):
                self.read = _named(order)
            else:
                tally.refused["bad_line"] += 1


def frame_of(line: Line) -> CanFrame:
    """Return the frame of a line.

    Raises
    ------
    ValueError
        It is damaged.
    """
    if len(line.data) < line.length or line.length > (64 if line.flexible else 8):
        raise ValueError("bad_line")
    identifier = int(line.identifier, 16)
    data = bytes.fromhex(b" ".join(line.data[: line.length]).decode("latin-1"))
    if not 0 <= identifier <= LARGEST_EXTENDED or len(data) != line.length:
        raise ValueError("bad_line")
    return CanFrame(identifier, data, len(line.identifier) > _STANDARD_DIGITS, line.flexible)


def frames(file: BinaryIO, tally: Tally) -> Iterator[LoggedFrame]:
    """Yield the frames of a recording; a damaged line is counted and ends nothing."""
    head = _Head()
    for raw in lines(file, tally):
        text = raw.strip()
        if text[:1] == b";":
            head.take(text, tally)
            continue
        if not text:
            continue
        try:
            line = head.read(text.split())
            if line is None:
                tally.skipped += 1
                continue
            frame = frame_of(line)
        except (ValueError, IndexError):
            tally.refused["bad_line"] += 1
            continue
        yield LoggedFrame(head.start + line.time, line.channel.decode("latin-1"), frame)
