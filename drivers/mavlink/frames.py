"""Frames in bytes: finding MAVLink 1 and 2 frames in a stream or a file, checked, before anything is decoded.

pymavlink's own parser is not used for reading, for three reasons. After one wrong byte it believes the length
that follows and swallows up to 280 bytes of good frames; it decodes everything (10 µs a message) where most
ids are not wanted; and it raises. Here a candidate whose checksum fails costs one byte, and unwanted frames
are never decoded.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from enum import StrEnum
from mmap import mmap
from typing import NamedTuple

from drivers.mavlink.dialect import (
    LAYOUTS,
    MARKER_1,
    MARKER_2,
    SIGNATURE_LENGTH,
    SIGNED,
    Layout,
    Message,
    checksum,
)

MARKERS = re.compile(b"[\xfd\xfe]")
LONGEST = 280


class Fault(StrEnum):
    """Why the bytes at a place are no frame; the value is the name it is counted under."""

    NO_MARKER = "bad_prefix"
    INCOMPLETE = "truncated"
    FLAGS = "unknown_flags"
    CHECKSUM = "bad_checksum"
    UNKNOWN = "unknown_message"


class Frame(NamedTuple):
    """One checked frame. ``layout`` is ``None`` when no dialect knows the id: then it is unchecked."""

    identifier: int
    system: int
    component: int
    layout: Layout | None
    raw: bytes

    @property
    def signed(self) -> bool:
        """Whether a signature follows the checksum (unchecked here)."""
        return self.raw[0] == MARKER_2 and bool(self.raw[2] & SIGNED)

    @property
    def sequence(self) -> int:
        """The number that its sender gave it, 0 to 255."""
        return self.raw[4] if self.raw[0] == MARKER_2 else self.raw[2]

    def message(self) -> Message:
        """Decode the payload.

        Raises
        ------
        ValueError
            No dialect knows the message.
        """
        if self.layout is None:
            raise ValueError(f"message {self.identifier}: not in the dialect, nothing to decode it with")
        start = 10 if self.raw[0] == MARKER_2 else 6
        payload = self.raw[start : start + self.raw[1]]
        return Message(self.layout.name, self.system, self.component, self.layout.unpack(payload))


def frame_at(data: bytes | bytearray | mmap, start: int) -> Frame | Fault:
    """Read the frame that starts at ``start``, or say why there is none.

    Never raises on any bytes. A frame of an unknown message is returned unchecked, without a layout.
    """
    head = data[start : start + 10]
    if len(head) < 3:
        return Fault.INCOMPLETE if not head or head[0] in (MARKER_1, MARKER_2) else Fault.NO_MARKER
    if head[0] == MARKER_2:
        return _frame_2(data, start, bytes(head))
    if head[0] == MARKER_1:
        return _frame_1(data, start, bytes(head))
    return Fault.NO_MARKER


def _frame_2(data: bytes | bytearray | mmap, start: int, head: bytes) -> Frame | Fault:
    if head[2] & ~SIGNED:
        return Fault.FLAGS
    if len(head) < 10:
        return Fault.INCOMPLETE
    body = head[1] + 10
    length = body + 2 + (SIGNATURE_LENGTH if head[2] else 0)
    raw = bytes(data[start : start + length])
    if len(raw) < length:
        return Fault.INCOMPLETE
    identifier = head[7] | head[8] << 8 | head[9] << 16
    return _checked(raw, body, identifier, head[5], head[6])


def _frame_1(data: bytes | bytearray | mmap, start: int, head: bytes) -> Frame | Fault:
    body = head[1] + 6
    raw = bytes(data[start : start + body + 2])
    if len(raw) < body + 2:
        return Fault.INCOMPLETE
    return _checked(raw, body, head[5], head[3], head[4])


def _checked(raw: bytes, body: int, identifier: int, system: int, component: int) -> Frame | Fault:
    layout = LAYOUTS.get(identifier)
    if layout is not None and checksum(raw[1:body] + layout.seed) != raw[body] | raw[body + 1] << 8:
        return Fault.CHECKSUM
    return Frame(identifier, system, component, layout, raw)


class FrameScanner:
    """Finds the frames in a stream of bytes that arrives in pieces.

    Attributes
    ----------
    faults : Counter[str]
        What was refused: a stretch of bytes that is no frame counts once, under what was wrong where it
        began; ``lost_bytes`` is the length of all such stretches.
    """

    def __init__(self) -> None:
        self.faults: Counter[str] = Counter()
        self._buffer = b""
        self._lost = False

    def feed(
        self, data: bytes, take: Callable[[Frame], None], take_unknown: Callable[[Frame], None] | None = None
    ) -> None:
        """Take in bytes and hand each whole frame to ``take``, those of unknown messages to the other."""
        data = self._buffer + data if self._buffer else data
        at = 0
        while at < len(data):
            frame = frame_at(data, at)
            if isinstance(frame, Frame) and (frame.layout is not None or self._plausible(data, at, frame)):
                self._lost = False
                at += len(frame.raw)
                if frame.layout is None:
                    self.faults[Fault.UNKNOWN] += 1
                    if take_unknown is not None:
                        take_unknown(frame)
                else:
                    take(frame)
            elif frame is Fault.INCOMPLETE:
                break
            else:
                at = self._skip(data, at, frame)
        self._buffer = data[at:]

    def forget(self) -> None:
        """Drop what is left of a frame, when the stream that it belonged to has ended."""
        self._buffer = b""
        self._lost = False

    @staticmethod
    def _plausible(data: bytes, at: int, frame: Frame) -> bool:
        """Whether an unknown message is believed: another frame, or nothing, follows it."""
        end = at + len(frame.raw)
        return end == len(data) or data[end] in (MARKER_1, MARKER_2)

    def _skip(self, data: bytes, at: int, fault: Frame | Fault) -> int:
        """Step over a byte that starts no frame, to the next that may; count the stretch once."""
        if not self._lost:
            self.faults[fault if isinstance(fault, Fault) else Fault.UNKNOWN] += 1
            self._lost = True
        found = MARKERS.search(data, at + 1)
        after = found.start() if found else len(data)
        self.faults["lost_bytes"] += after - at
        return after
