"""The keeping process: writes the newest checkpoint, so that no disk ever holds the loop up.

It is written beside the old one and then takes its place, so at every moment there is a whole one. When the disk is
full or fails, one message says so, and the next one is tried all the same.
"""

from __future__ import annotations

import logging
import os
import select
import signal
import socket
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from service.config import Configuration

LARGEST = 256 * 1024

_log = logging.getLogger(__name__)


def path_of(configuration: Configuration) -> Path:
    """Return where the checkpoint of a configuration's vehicle lies."""
    return Path(configuration.state.directory) / f"{configuration.vehicle.name}.checkpoint"


class Keeper:
    """Writes what comes out of a queue to a file, each in the place of the one before.

    Parameters
    ----------
    path : Path
        Of the checkpoint.
    checkpoints : socket.socket
        Non-blocking inlet of the queue.

    Attributes
    ----------
    written : int
        Checkpoints on the disk so far.
    """

    def __init__(self, path: Path, checkpoints: socket.socket) -> None:
        self.written = 0
        self._path = path
        self._beside = path.with_name(path.name + ".new")
        self._checkpoints = checkpoints
        self._complaint = ""
        self._poll = select.poll()
        self._poll.register(checkpoints, select.POLLIN)

    def step(self, wait_ms: int) -> None:
        """Wait for a checkpoint, at most ``wait_ms``, and write the newest that has come."""
        if not self._poll.poll(wait_ms):
            return
        newest: bytes | None = None
        while (datagram := self._next()) is not None:
            newest = datagram
        if newest is not None:
            self._write(newest)

    def _next(self) -> bytes | None:
        try:
            return self._checkpoints.recv(LARGEST)
        except BlockingIOError:
            return None

    def _write(self, data: bytes) -> None:
        try:
            with self._beside.open("wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            self._beside.replace(self._path)
        except OSError as error:
            complaint = f"{self._path}: {error.strerror}; there is no new checkpoint while that is so"
            if complaint != self._complaint:
                _log.warning("state: %s", complaint)
            self._complaint = complaint
            return
        self.written += 1
        if self._complaint:
            _log.info("state: %s: written again", self._path)
            self._complaint = ""


def run(path: Path, checkpoints: socket.socket) -> None:
    """Keep until SIGTERM, and what waits then."""
    stopping = False

    def stop(_signal: int, _frame: object) -> None:
        nonlocal stopping
        stopping = True

    signal.signal(signal.SIGTERM, stop)
    keeper = Keeper(path, checkpoints)
    while not stopping:
        keeper.step(200)
    keeper.step(0)
