"""One frame of a CAN bus, whatever brought it: a socket, a serial adapter, multicast or a log file."""

from __future__ import annotations

from typing import NamedTuple

LARGEST_STANDARD = 0x7FF
LARGEST_EXTENDED = 0x1FFFFFFF
"""Identifiers of 11 and of 29 bits; as masks: what of a word is the identifier."""


class CanFrame(NamedTuple):
    """A data frame.

    Attributes
    ----------
    identifier : int
        11 or 29 bits, without the flags that SocketCAN keeps above them.
    data : bytes
        At most 8 bytes, or 64 on a CAN FD bus.
    extended : bool
        The identifier has 29 bits.
    flexible : bool
        A CAN FD frame, which changes how DroneCAN packs the last array of a message.
    """

    identifier: int
    data: bytes
    extended: bool = True
    flexible: bool = False
