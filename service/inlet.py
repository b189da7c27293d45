"""The loop's end of one link: what came, decoded, for as long as the tick allows.

What is not taken now stays in the kernel's queue for the next tick; when that overflows, the link counts what
it could not send. So a flood makes nothing late, and everything lost is counted by somebody.
"""

from __future__ import annotations

import socket
import time
from collections.abc import Callable

import msgspec

from drivers.sample import LinkReport, Sample, decode
from service.channels import LARGEST, Outlet
from service.estimate import LinkStatus
from service.records import TAKEN

MOST_DATAGRAMS = 1024
"""At most so many are taken in one tick, however fast they are dealt with."""

_NANOSECONDS = 1e-9


class Inlet:
    """Drains one link's queue without ever waiting.

    Parameters
    ----------
    name : str
        The link's.
    end : socket.socket
        Non-blocking inlet of its queue.
    records : Outlet, optional
        Where samples go that a recording is to hold, in the datagrams in which they came.
    """

    def __init__(self, name: str, end: socket.socket, records: Outlet | None = None) -> None:
        self.name = name
        self._socket = end
        self._records = records
        self._record = memoryview(bytearray(TAKEN) + bytearray(LARGEST))
        self._room = self._record[len(TAKEN) :]
        self._report: LinkReport | None = None
        self._heard: int | None = None
        self.undecodable = 0
        """Datagrams that were none."""
        self.samples = 0
        """Samples taken so far."""
        self.waiting = 0
        """Datagrams that were taken in the last tick, and one more when some had to be left."""
        self.deferred = 0
        """Ticks that left some in the queue."""

    def drain(self, ingest: Callable[[list[Sample]], None], until_ns: int) -> None:
        """Hand on what waits: one datagram at least, none once the monotonic clock reads ``until_ns``."""
        self.waiting = 0
        while True:
            try:
                length = self._socket.recv_into(self._room)
            except BlockingIOError:
                return
            self.waiting += 1
            self._take(length, ingest)
            if self.waiting >= MOST_DATAGRAMS or time.monotonic_ns() >= until_ns:
                break
        if self._has_more():
            self.waiting += 1
            self.deferred += 1

    def _has_more(self) -> bool:
        try:
            self._socket.recv(1, socket.MSG_PEEK)
        except BlockingIOError:
            return False
        return True

    def _take(self, length: int, ingest: Callable[[list[Sample]], None]) -> None:
        try:
            datagram = decode(self._room[:length])
        except msgspec.MsgspecError:
            self.undecodable += 1
            return
        if isinstance(datagram, LinkReport):
            self._report = datagram
            return
        self.samples += len(datagram.samples)
        if datagram.samples:
            self._heard = datagram.samples[-1].received
            if self._records is not None:
                self._records.send(self._record[: len(TAKEN) + length])
        ingest(datagram.samples)

    @property
    def dropped(self) -> int:
        """Samples that the link could not send because this queue was full, as it last reported."""
        return self._report.dropped if self._report else 0

    def status(self, now_ns: int) -> LinkStatus:
        """Return what is known of the link; its state is ``starting`` until its process has reported."""
        report = self._report or LinkReport(self.name, "starting")
        return LinkStatus(
            name=self.name,
            state=report.state,
            reason=report.reason,
            messages=report.messages,
            samples=report.samples,
            malformed=report.malformed,
            unusable=report.unusable,
            ignored=report.ignored,
            dropped=report.dropped,
            lost=report.lost,
            clock=report.clock,
            offset=report.offset,
            jitter=report.jitter,
            age=None if self._heard is None else max(0.0, (now_ns - self._heard) * _NANOSECONDS),
        )
