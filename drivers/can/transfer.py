"""Frames into transfers, as in the DroneCAN specification, "CAN bus transport layer", for messages.

The last byte of every frame says whether it starts or ends a transfer, a bit that toggles from frame to
frame, and the transfer's number. A transfer of several frames begins with a checksum (CRC-16-CCITT, started
from the type's signature).

Memory is bounded by construction: one transfer in progress for each type and source, each no longer than its
type.
"""

from __future__ import annotations

import binascii
from collections import Counter
from collections.abc import Mapping
from typing import NamedTuple

import msgspec

from drivers.can.dsdl import DataType
from drivers.can.frame import CanFrame

TIME_OUT_NS = 2_000_000_000

_START = 0x80
_END = 0x40
_TOGGLE = 0x20
_NUMBER = 0x1F

_SERVICE = 0x80
_SOURCE = 0x7F

_LARGEST_FRAME = 64


def message_identifier(data_type: int) -> tuple[int, int]:
    """Return the CAN identifier and the mask by which a filter admits one message type from any source."""
    return data_type << 8, 0xFFFF << 8 | _SERVICE


class Transfer(NamedTuple):
    """A complete payload, without checksum and tail bytes.

    ``received_ns`` is when its first frame arrived: the moment nearest to the measurement.
    """

    data_type: DataType
    source: int
    payload: bytes
    flexible: bool
    received_ns: int


class _Slot(msgspec.Struct):
    """What has arrived of the current transfer of one type from one source."""

    payload: bytearray = msgspec.field(default_factory=bytearray)
    number: int = 0
    toggle: int = 0
    active: bool = False
    started_ns: int = 0
    last_frame: bytes = b""
    last_ns: int = 0
    abandoned: int = -1


class Reassembler:
    """Collects the frames of the wanted message types.

    Parameters
    ----------
    wanted : Mapping[int, DataType]
        By data type id.

    Attributes
    ----------
    malformed : Counter[str]
        ``empty_frame``; ``missing_start`` (joined in the middle, or the first frame was lost);
        ``toggle_error`` (a frame in the middle was lost); ``truncated_transfer`` (a new one began, or two
        seconds passed); ``bad_checksum``; ``oversize_transfer`` (longer than its type can be). Each transfer
        is counted once.
    repeated : int
        Frames seen twice, which a CAN bus is allowed to deliver, and which are left out.
    ignored : int
        Frames of other types, services, anonymous nodes, and with 11-bit identifiers.
    """

    def __init__(self, wanted: Mapping[int, DataType]) -> None:
        self._wanted = wanted
        self._slots: dict[tuple[int, int], _Slot] = {}
        self.malformed: Counter[str] = Counter()
        self.repeated = 0
        self.ignored = 0

    def accept(self, frame: CanFrame, received_ns: int) -> Transfer | None:
        """Take one frame; return the transfer that it completes, if it completes one."""
        identifier = frame.identifier
        source = identifier & _SOURCE
        data_type = self._wanted.get(identifier >> 8 & 0xFFFF)
        if data_type is None or not frame.extended or identifier & _SERVICE or source == 0:
            self.ignored += 1
            return None
        if not frame.data:
            self.malformed["empty_frame"] += 1
            return None
        slot = self._slots.setdefault((data_type.identifier, source), _Slot())
        if frame.data == slot.last_frame and abs(received_ns - slot.last_ns) < TIME_OUT_NS:
            self.repeated += 1
            return None
        slot.last_frame = frame.data
        slot.last_ns = received_ns
        if not self._fits(slot, frame, received_ns):
            return None
        return self._extend(slot, data_type, source, frame)

    def _fits(self, slot: _Slot, frame: CanFrame, received_ns: int) -> bool:
        """Start or check the transfer that the frame belongs to; false when the frame belongs to none."""
        tail = frame.data[-1]
        if slot.active and (tail & _START or abs(received_ns - slot.started_ns) > TIME_OUT_NS):
            self._abandon(slot, "truncated_transfer")
        if tail & _START:
            return self._start(slot, tail, received_ns)
        if slot.active and tail & _NUMBER != slot.number:
            self._abandon(slot, "truncated_transfer")
        if not slot.active:
            if slot.abandoned != tail & _NUMBER:
                self.malformed["missing_start"] += 1
                slot.abandoned = tail & _NUMBER
            return False
        if tail & _TOGGLE != slot.toggle:
            self._abandon(slot, "toggle_error")
            return False
        return True

    def _start(self, slot: _Slot, tail: int, received_ns: int) -> bool:
        slot.number = tail & _NUMBER
        if tail & _TOGGLE:  # the first frame's toggle is clear (set: another protocol, Cyphal)
            self._abandon(slot, "toggle_error")
            return False
        slot.payload.clear()
        slot.active = True
        slot.abandoned = -1
        slot.toggle = 0
        slot.started_ns = received_ns
        return True

    def _abandon(self, slot: _Slot, kind: str) -> None:
        self.malformed[kind] += 1
        slot.active = False
        slot.abandoned = slot.number

    def _extend(self, slot: _Slot, data_type: DataType, source: int, frame: CanFrame) -> Transfer | None:
        tail = frame.data[-1]
        slot.payload += frame.data[:-1]
        slot.toggle ^= _TOGGLE
        padding = _LARGEST_FRAME if frame.flexible else 0
        single = tail & (_START | _END) == _START | _END
        if len(slot.payload) > data_type.largest + padding + (0 if single else 2):
            self._abandon(slot, "oversize_transfer")
            return None
        if not tail & _END:
            return None
        payload = bytes(slot.payload)
        if not single:
            checksum, payload = int.from_bytes(payload[:2], "little"), payload[2:]
            if checksum != binascii.crc_hqx(payload, data_type.checksum_start):
                self._abandon(slot, "bad_checksum")
                return None
        slot.active = False
        slot.abandoned = -1
        return Transfer(data_type, source, payload, frame.flexible, slot.started_ns)
