"""Orders: what a user tells the belief through the publishing process, as datagrams to the loop.

There is one: begin anew. It is checked before it is sent (:mod:`service.publish.desk`), so the loop only takes it; what
it cannot read it counts.
"""

from __future__ import annotations

import socket
from collections.abc import Callable

from pydantic import ValidationError

from service.channels import Outlet
from service.config import Start
from service.records import ORDER

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
    records : Outlet, optional
        Where orders go that a recording is to hold.

    Attributes
    ----------
    malformed : int
        Datagrams that were no order.
    """

    def __init__(
        self, end: socket.socket, reinitialize: Callable[[Start], None], records: Outlet | None = None
    ) -> None:
        self.malformed = 0
        self._socket = end
        self._reinitialize = reinitialize
        self._records = records

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
        if self._records is not None:
            self._records.send(ORDER + datagram)
