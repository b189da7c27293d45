"""How the processes talk: pairs of connected datagram sockets, made by the supervisor before anybody starts.

The kernel keeps the datagrams whole, in order, wakes the reader and bounds the queue (by bytes: the two ends
know each other, so the limit on the number of waiting datagrams does not apply). Nobody ever waits for a
reader: a full queue refuses, the sender counts, and the count is published. The supervisor holds both ends
open, so that a pair outlives the processes that use it.

What the loop tells the publisher begins with a tag. What a process tells the supervisor is a beat (its count,
eight bytes) or, before something that may take long, a text that says what.
"""

from __future__ import annotations

import contextlib
import socket
import struct
from typing import NamedTuple

ESTIMATE = b"E"
BUDGET = b"B"
SENSORS = b"S"
HEALTH = b"H"
CLOUD = b"P"
HYPOTHESES = b"Y"
PROCESSES = b"R"

LARGEST = 256 * 1024
"""Bytes of the largest datagram that a reader makes room for."""

_LENGTH = struct.Struct("<I")
_BEAT = struct.Struct("<Q")


class Pair(NamedTuple):
    """Two ends of one queue: datagrams go in at the outlet and come out at the inlet."""

    outlet: socket.socket
    inlet: socket.socket

    def close(self) -> None:
        """Close both ends."""
        self.outlet.close()
        self.inlet.close()


def pair(capacity: int) -> Pair:
    """Make a non-blocking pair with room for ``capacity`` bytes (the kernel's overhead counts as well).

    Beyond ``net.core.wmem_max`` the room is granted only with CAP_NET_ADMIN; without it, it is that limit.
    """
    outlet, inlet = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    for end in (outlet, inlet):
        end.setblocking(False)
        end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, capacity)
        with contextlib.suppress(PermissionError):
            end.setsockopt(socket.SOL_SOCKET, _SO_SNDBUFFORCE, capacity)
    return Pair(outlet, inlet)


_SO_SNDBUFFORCE = 32  # <asm-generic/socket.h>; the socket module does not name it


def inherited(descriptor: int) -> socket.socket:
    """Return the end of a pair that the supervisor passed to this process, non-blocking."""
    end = socket.socket(fileno=descriptor)
    end.setblocking(False)
    return end


class Outlet:
    """The sending end of a queue: never waits, and counts what was refused."""

    def __init__(self, end: socket.socket) -> None:
        self.end = end
        self.dropped = 0
        """Datagrams that the kernel did not take."""

    def send(self, datagram: bytes | bytearray | memoryview) -> bool:
        """Send one datagram; False, and counted, when it is not taken: no room, nobody to read, too large."""
        try:
            self.end.send(datagram)
        except OSError:
            self.dropped += 1
            return False
        return True


class Heart:
    """A process's line to the supervisor."""

    def __init__(self, end: socket.socket) -> None:
        self._socket = end
        self._outlet = Outlet(end)
        self._beats = 0

    def beat(self) -> None:
        """Say: alive, and at work."""
        self._beats += 1
        self._outlet.send(_BEAT.pack(self._beats))

    def announce(self, undertaking: str) -> None:
        """Say what begins now and may take long: until the next beat more patience is due."""
        self._outlet.send(b"begin: " + undertaking.encode())

    def called(self) -> bool:
        """Tell whether the supervisor asked to hear again what is said only on change."""
        try:
            return bool(self._socket.recv(1))
        except OSError:
            return False


def undertaking(datagram: bytes) -> str | None:
    """Return the text of an announcement that came from a :class:`Heart`, or None for a beat."""
    return None if len(datagram) == _BEAT.size else datagram.decode(errors="replace").removeprefix("begin: ")


def cloud(description: bytes, rows: bytes) -> bytes:
    """Return a cloud's datagram: tag, length of its JSON description, that, and the rows of float32."""
    return b"".join((CLOUD, _LENGTH.pack(len(description)), description, rows))
