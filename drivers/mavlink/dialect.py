"""Where pymavlink enters: the dialect ``all`` in MAVLink 2, as layouts of its messages and as bytes to send.

Only here is pymavlink imported for its messages, and only its tables are used to read: the size, the order of
the fields and the CRC seed of each message. Its parser is not (:mod:`drivers.mavlink.frames` says why).
"""

from __future__ import annotations

import os
from collections import namedtuple
from collections.abc import Callable
from struct import Struct
from typing import Any, NamedTuple, Protocol, cast

# read by pymavlink when it is imported: without it the environment of whoever started us would choose
os.environ["MAVLINK20"] = "1"
os.environ["MAVLINK_DIALECT"] = "all"

from pymavlink.dialects.v20 import all as pymavlink_all

MARKER_1 = 0xFE
MARKER_2 = 0xFD
SIGNED = 0x01
SIGNATURE_LENGTH = 13

mavlink: Any = pymavlink_all
"""The generated module, untyped: its ``MAVLink_…_message`` classes and constants."""


class MessageClass(Protocol):
    """What pymavlink's generated classes say about a message."""

    id: int
    msgname: str
    crc_extra: int
    unpacker: Struct
    ordered_fieldnames: list[str]
    lengths: list[int]


class Layout:
    """How one message lies in its bytes.

    Attributes
    ----------
    identifier, name : int, str
        Of the message.
    seed : bytes
        CRC_EXTRA, the byte that binds the checksum to this definition.
    """

    def __init__(self, definition: MessageClass) -> None:
        self.identifier = definition.id
        self.name = definition.msgname
        self.seed = bytes((definition.crc_extra,))
        self._unpacker = definition.unpacker
        self._make = _field_maker(definition)

    def unpack(self, payload: bytes) -> Any:
        """Return the fields by name; cut zeros are put back, bytes of a newer definition are cut off."""
        size = self._unpacker.size
        if len(payload) != size:
            payload = payload[:size].ljust(size, b"\0")
        return self._make(self._unpacker.unpack(payload))


def _field_maker(definition: MessageClass) -> Callable[[tuple[Any, ...]], Any]:
    """Return what makes a named tuple of the values in wire order; arrays become tuples."""
    names = definition.ordered_fieldnames
    fields = cast(Any, namedtuple)(definition.msgname, names)
    make = cast(Callable[[Any], Any], fields._make)
    # lengths counts values: a char array is one value of several bytes
    lengths = definition.lengths
    if all(length == 1 for length in lengths):
        return make
    starts = [sum(lengths[:index]) for index in range(len(lengths))]

    def with_arrays(values: tuple[Any, ...]) -> Any:
        return make(
            values[start] if length == 1 else values[start : start + length]
            for start, length in zip(starts, lengths, strict=True)
        )

    return with_arrays


class Message(NamedTuple):
    """One message understood: its name, who said it, its fields as the wire has them (units of the wire)."""

    name: str
    system: int
    component: int
    fields: Any


LAYOUTS: dict[int, Layout] = {
    identifier: Layout(definition)
    for identifier, definition in cast(dict[int, MessageClass], mavlink.mavlink_map).items()
}
IDENTIFIERS: dict[str, int] = {layout.name: identifier for identifier, layout in LAYOUTS.items()}


def _checksum_of() -> Callable[[bytes], int]:
    """Return the CRC-16/MCRF4XX that pymavlink found: compiled where fastcrc is there, else in Python."""
    compiled = cast(Callable[[bytes, int], int] | None, mavlink.mcrf4xx)
    if compiled is None:
        return lambda data: cast(int, mavlink.x25crc(data).crc)
    return lambda data: compiled(data, 0xFFFF)


checksum = _checksum_of()
