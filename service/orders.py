"""Orders: what a user tells the belief through the publishing process, as datagrams to the loop.

There is one: begin anew. It is checked before it is sent (:mod:`service.publish.desk`), so the loop only takes it; what
it cannot read it counts.
"""

from __future__ import annotations

import socket
from collections.abc import Callable

from pydantic import ValidationError

from service.config import Start

LARGEST = 4096
"""Bytes of an order."""


class Orders:
    """The loop's end: takes an order when there is one, and never waits.

    Parameters
    ----------
    end : socket.socket
        Non-blocking inlet of the queue.
    reinitialize : callable
        What a new start is told to.

    Attributes
    ----------
    malformed : int
        Datagrams that were no order.
    """

    def __init__(self, end: socket.socket, reinitialize: Callable[[Start], None]) -> None:
        self.malformed = 0
        self._socket = end
        self._reinitialize = reinitialize

    def take(self) -> None:
        """Pass on one order, if one waits."""
        try:
            datagram = self._socket.recv(LARGEST)
        except OSError:
            return
        try:
            start = Start.model_validate_json(datagram)
        except ValidationError:
            self.malformed += 1
            return
        self._reinitialize(start)
