"""The recording process: writes the decision log, so that no disk ever holds the loop or the publisher up.

A disk that is full or fails ends the recording with one message; everything else goes on. When the loop is started
anew its ticks begin at 0 again, and the log gets a new head.
"""

from __future__ import annotations

import logging
import select
import signal
import socket
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TextIO

from service.decisions import decided, header, line

LARGEST = 4096
"""Bytes of a datagram: a thousand links."""

FLUSH_PERIOD = 1.0
QUIET = 0.3
"""Seconds without a tick after which the loop has stopped, too."""

_log = logging.getLogger(__name__)


class Recorder:
    """Writes what comes out of a queue to a file.

    Parameters
    ----------
    path : Path
        Written at its end.
    links : Sequence[str]
        Names of the links, in the order of the configuration.
    records : socket.socket
        Non-blocking inlet of the queue.
    """

    def __init__(self, path: Path, links: Sequence[str], records: socket.socket) -> None:
        self._path = path
        self._head = header(links)
        self._records = records
        self._file: TextIO | None = None
        self._headed = False
        self._flushed = 0.0
        self._poll = select.poll()
        self._poll.register(records, select.POLLIN)
        self._try(self._open)

    @property
    def recording(self) -> bool:
        """Whether the file is still being written."""
        return self._file is not None

    def step(self, wait_ms: int) -> bool:
        """Wait for records, at most ``wait_ms``, and write them; tell whether any came."""
        came = False
        if self._poll.poll(wait_ms):
            while (datagram := self._next()) is not None:
                came = True
                self._write(datagram)
        now = time.monotonic()
        if now - self._flushed >= FLUSH_PERIOD:
            self._flushed = now
            self._try(self._flush)
        return came

    def close(self) -> None:
        """Write what waits in memory, and close the file."""
        self._try(self._flush)
        if self._file is not None:
            self._file.close()
            self._file = None

    def _next(self) -> bytes | None:
        try:
            return self._records.recv(LARGEST)
        except BlockingIOError:
            return None

    def _open(self) -> None:
        self._file = self._path.open("a", encoding="utf-8")

    def _flush(self) -> None:
        if self._file is not None:
            self._file.flush()

    def _write(self, datagram: bytes) -> None:
        decision = decided(datagram)
        head = "" if self._headed and decision.tick else self._head
        self._headed = True
        self._try(lambda: self._file and self._file.write(head + line(decision)))

    def _try(self, act: Callable[[], object]) -> None:
        try:
            act()
        except OSError as error:
            _log.error("%s: %s; the recording of decisions ends here", self._path, error.strerror)
            file, self._file = self._file, None
            _discard(file)


def _discard(file: TextIO | None) -> None:
    """Close a file whose last bytes cannot be written."""
    if file is not None:
        try:
            file.close()
        except OSError:
            return  # said already


def run(path: Path, links: Sequence[str], records: socket.socket) -> None:
    """Record until SIGTERM, and then until the loop has fallen silent."""
    stopping = False

    def stop(_signal: int, _frame: object) -> None:
        nonlocal stopping
        stopping = True

    signal.signal(signal.SIGTERM, stop)
    recorder = Recorder(path, links, records)
    while not stopping:
        recorder.step(200)
    while recorder.step(round(1e3 * QUIET)):
        pass
    recorder.close()
