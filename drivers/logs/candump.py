"""Recordings of can-utils: ``candump -L``, plain or gzipped, one line a frame.

One line is one frame: ``(1700000000.123456) can0 18042F7B#0011223344556677``. After a second ``#`` stands the
flags digit of a CAN FD frame; ``#R`` is a remote frame; a trailing ``R`` or ``T`` says received or
transmitted. An identifier with more than three digits has 29 bits; above them SocketCAN keeps the flag of an
error frame.
"""

from __future__ import annotations

import re
from binascii import unhexlify
from collections.abc import Iterator
from functools import lru_cache
from typing import BinaryIO

from drivers.can import CanFrame
from drivers.can.frame import LARGEST_EXTENDED
from drivers.logs.canlog import LoggedFrame, Tally, lines

_LINE = re.compile(
    rb"\((?P<seconds>\d{1,11})\.(?P<fraction>\d{1,9})\)\s+(?P<channel>\S{1,64})\s+"
    rb"(?P<identifier>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(?:#(?P<flags>[0-9A-Fa-f]))?"
    rb"(?:(?P<remote>[Rr][0-9A-Fa-f]?)|(?P<data>(?:[0-9A-Fa-f]{2})*))(?:\s+[RrTt])?\s*"
)
_ERROR_FRAME = 0x20000000
_STANDARD_DIGITS = 3
_LARGEST_CLASSIC = 8
_LARGEST_FLEXIBLE = 64


def parse(line: bytes) -> LoggedFrame | None:
    """Return the frame of one line of ``candump -L``, or ``None`` for a remote frame.

    Raises
    ------
    ValueError
        The line is damaged (``bad_line``) or records an error of the bus (``error_frame``).
    """
    match = _LINE.fullmatch(line)
    if match is None:
        raise ValueError("bad_line")
    seconds, fraction, channel, digits, flags, remote, content = match.groups()
    identifier = int(digits, 16)
    if identifier & _ERROR_FRAME:
        raise ValueError("error_frame")
    if remote is not None:
        return None
    data = unhexlify(content)
    flexible = flags is not None
    if len(data) > (_LARGEST_FLEXIBLE if flexible else _LARGEST_CLASSIC):
        raise ValueError("bad_line")
    frame = CanFrame(identifier & LARGEST_EXTENDED, data, len(digits) > _STANDARD_DIGITS, flexible)
    return LoggedFrame(int(seconds + fraction.ljust(9, b"0")), _text(channel), frame)


@lru_cache(maxsize=64)
def _text(channel: bytes) -> str:
    return channel.decode(errors="replace")


def frames(file: BinaryIO, tally: Tally) -> Iterator[LoggedFrame]:
    """Yield the frames of a recording, plain or gzipped; a damaged line is counted and ends nothing."""
    for line in lines(file, tally):
        try:
            logged = parse(line)
        except ValueError as error:
            if line.strip():
                tally.refused[str(error)] += 1
            continue
        if logged is None:
            tally.skipped += 1
        else:
            yield logged
