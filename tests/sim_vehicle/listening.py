"""A companion on a real socket, which waits for what it wants, with a bound."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import all as mavlink

LONGEST_WAIT = 30.0


class Companion:
    """A MAVLink companion on a UDP port of the system's choosing."""

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(LONGEST_WAIT)
        self._codec = mavlink.MAVLink(None, srcSystem=1, srcComponent=197)
        self._codec.robust_parsing = True
        self._peer: Any = None
        self.port: int = self._socket.getsockname()[1]

    def meet(self, port: int) -> None:
        """Speak first, to a port that waits for that."""
        self._peer = ("127.0.0.1", port)
        self.say(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3))

    def say(self, message: Any) -> None:
        """Send a message to whoever was last heard."""
        self._socket.sendto(message.pack(self._codec), self._peer)

    def wait_for(self, wanted: Callable[[Any], bool]) -> Any:
        """Return the next message that is wanted; fail after the longest wait."""
        end = time.monotonic() + LONGEST_WAIT
        while time.monotonic() < end:
            data, self._peer = self._socket.recvfrom(65_535)
            for message in self._codec.parse_buffer(data) or []:
                if wanted(message):
                    return message
        raise AssertionError(f"not heard in {LONGEST_WAIT} s")

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


def is_a(kind: str) -> Callable[[Any], bool]:
    """Return a test for the type of a message."""
    return lambda message: message.get_type() == kind
