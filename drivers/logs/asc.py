"""Vector's text recordings (.asc) of classic CAN and CAN FD, one event a line; gzipped ones, too.

``base hex|dec`` says how numbers are written, ``timestamps relative`` that each line tells the time since the
one before. Events that are no frames (bus statistics, error frames, J1939TP, …) are left out. The date in the head is
taken as UTC, for it says no zone; without one the clock starts at 0.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import BinaryIO

from drivers.can import CanFrame
from drivers.can.frame import LARGEST_EXTENDED, LARGEST_STANDARD
from drivers.logs.canlog import LoggedFrame, Tally, lines
from drivers.sample import SECOND

_BASE = re.compile(rb"base\s+(?P<base>hex|dec)(?:\s+timestamps\s+(?P<stamps>absolute|relative))?.*", re.I)
_DATE = re.compile(rb"(?:date|begin\s+triggerblock)\s+(?:[A-Za-z]{2,3}\s+)?(?P<date>\S.*)", re.I)
_EVENT = re.compile(rb"(?P<seconds>\d{1,11})\.(?P<fraction>\d{1,9})\s+(?P<rest>\S.*)")
_CLASSIC = re.compile(
    rb"(?P<channel>\d{1,3})\s+(?P<identifier>[0-9A-Fa-f]{1,10})(?P<extended>x?)\s+(?:Rx|Tx|TxRq)\s+"
    rb"(?:(?P<remote>r)(?:\s.*)?|d\s+(?P<length>[0-9A-Fa-f]{1,2})(?P<data>(?:\s+[0-9A-Fa-f]{1,3})*)(?:\s+Length\s.*)?)",
    re.I,
)
_FLEXIBLE = re.compile(
    rb"CANFD\s+(?P<channel>\d{1,3})\s+(?:Rx|Tx|TxRq)\s+(?P<identifier>[0-9A-Fa-f]{1,10})(?P<extended>x?)\s+"
    rb"(?:(?!\d\s+\d\s)\S{1,128}\s+)?(?P<brs>[01])\s+(?P<esi>[01])\s+(?P<code>[0-9A-Fa-f]{1,2})\s+(?P<length>\d{1,2})"
    rb"(?P<data>(?:\s+[0-9A-Fa-f]{1,3})*).*",
    re.I,
)
_OF_A_FRAME = re.compile(rb"(?:\d{1,3}\s+\S{1,128}\s+(?:Rx|Tx)|CANFD)\b", re.I)
_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_GERMAN = {"mär": "mar", "mrz": "mar", "mai": "may", "okt": "oct", "dez": "dec"}
_FORMATS = ("%m %d %I:%M:%S.%f %p %Y", "%m %d %I:%M:%S %p %Y", "%m %d %H:%M:%S.%f %Y", "%m %d %H:%M:%S %Y")
_CLASSIC_BYTES, _FLEXIBLE_BYTES = 8, 64


def unix_of(date: str) -> int | None:
    """Return a date as Vector writes it (``Sat Sep 30 10:06:13.191 PM 2017``) as Unix nanoseconds, UTC."""
    words = date.lower().split()
    if not words:
        return None
    month = _GERMAN.get(words[0], words[0])
    if month not in _MONTHS:
        return None
    text = " ".join([str(_MONTHS.index(month) + 1), *words[1:]])
    for form in _FORMATS:
        try:
            moment = datetime.strptime(text, form).replace(tzinfo=UTC)
        except ValueError:
            continue
        whole = round((moment.replace(microsecond=0) - datetime(1970, 1, 1, tzinfo=UTC)).total_seconds())
        return max(0, whole * SECOND + moment.microsecond * 1_000)
    return None


class _Head:
    """What the lines that are no events have said so far."""

    def __init__(self) -> None:
        self.start = 0
        self.base = 16
        self.relative = False

    def read(self, line: bytes) -> bool:
        """Take in a line of the head; ``False`` when it is none."""
        if base := _BASE.fullmatch(line):
            self.base = 10 if base["base"].lower() == b"dec" else 16
            self.relative = (base["stamps"] or b"").lower() == b"relative"
            return True
        if date := _DATE.fullmatch(line):
            unix = unix_of(date["date"].decode("latin-1"))
            self.start = self.start if unix is None else unix
            return True
        return False


def frame_of(rest: bytes, base: int) -> tuple[str, CanFrame | None] | None:
    """Return bus and frame of what follows the time: no frame for a remote one, ``None`` for another event.

    Raises
    ------
    ValueError
        It is a frame, and damaged.
    """
    flexible = _FLEXIBLE.fullmatch(rest)
    match = flexible or _CLASSIC.fullmatch(rest)
    if match is None:
        if _OF_A_FRAME.match(rest) and not re.search(rb"errorframe", rest, re.I):
            raise ValueError("bad_line")
        return None
    channel = match["channel"].decode()
    if match["length"] is None or (flexible and int(match["length"]) == 0 and int(match["code"], 16) > 0):
        return channel, None
    identifier, extended = int(match["identifier"], base), bool(match["extended"])
    length = int(match["length"]) if flexible else min(_CLASSIC_BYTES, int(match["length"], base))
    values = [int(value, base) for value in match["data"].split()[:length]]
    fits = identifier <= (LARGEST_EXTENDED if extended else LARGEST_STANDARD) and length <= _FLEXIBLE_BYTES
    if not fits or len(values) < length or max(values, default=0) > 0xFF:
        raise ValueError("bad_line")
    return channel, CanFrame(identifier, bytes(values), extended, flexible is not None)


def frames(file: BinaryIO, tally: Tally) -> Iterator[LoggedFrame]:
    """Yield the frames of a recording; a damaged line is counted and ends nothing."""
    head = _Head()
    since = 0
    for raw in lines(file, tally):
        line = raw.strip()
        event = _EVENT.fullmatch(line)
        if event is None:
            known = not line or line[:2] == b"//" or head.read(line) or line[:1].isalpha()
            tally.refused["bad_line"] += not known
            continue
        stamp = int(event["seconds"]) * SECOND + int(event["fraction"].ljust(9, b"0"))
        since = since + stamp if head.relative else stamp
        try:
            found = frame_of(event["rest"], head.base)
        except ValueError:
            tally.refused["bad_line"] += 1
            continue
        if found is None or found[1] is None:
            tally.skipped += 1
        else:
            yield LoggedFrame(head.start + since, found[0], found[1])
