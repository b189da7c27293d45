"""The recording process: writes what the loop says, so that no disk ever holds the loop or the publisher up.

There are two files that it may write: the decision log (CSV), and the recording of the run (.mcap). A disk that is full
or fails ends a file with one message; everything else goes on.
"""

from __future__ import annotations

import logging
import select
import signal
import socket
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol

from service.decisions import DecisionFile
from service.records import LARGEST

FLUSH_PERIOD = 1.0
QUIET = 0.3
"""Seconds without a record after which the loop has stopped, too."""

_log = logging.getLogger(__name__)


class Sink(Protocol):
    """A file under construction; every method may raise :class:`OSError`, after which only ``discard`` is called."""

    def take(self, datagram: bytes) -> None:
        """Write what of a record belongs into the file."""
        ...

    def flush(self) -> None:
        """Hand what was written to the operating system."""
        ...

    def close(self) -> None:
        """Write what is left, and close the file."""
        ...

    def discard(self) -> None:
        """Close the file without that."""
        ...


class Ending:
    """A sink that fails once, with one message, and from then on takes no more.

    Parameters
    ----------
    path : Path
        For the message.
    what : str
        What ends then, for the message.
    make : callable
        Opens the sink.
    """

    def __init__(self, path: Path, what: str, make: Callable[[Path], Sink]) -> None:
        self._path = path
        self._what = what
        self._sink: Sink | None = None
        try:
            self._sink = make(path)
        except OSError as error:
            self._say(error)

    @property
    def open(self) -> bool:
        """Whether it is still being written."""
        return self._sink is not None

    def take(self, datagram: bytes) -> None:
        """Write a record."""
        self._try(lambda sink: sink.take(datagram))

    def flush(self) -> None:
        """Hand what was written to the operating system."""
        self._try(lambda sink: sink.flush())

    def close(self) -> None:
        """Write what is left, and close the file."""
        self._try(lambda sink: sink.close())
        self._sink = None

    def _try(self, act: Callable[[Sink], object]) -> None:
        if self._sink is None:
            return
        try:
            act(self._sink)
        except OSError as error:
            self._say(error)
            sink, self._sink = self._sink, None
            try:
                sink.discard()
            except OSError:
                return  # said already

    def _say(self, error: OSError) -> None:
        _log.error("%s: %s; %s ends here, the estimate goes on", self._path, error.strerror, self._what)


class Recorder:
    """Writes what comes out of a queue to files.

    Parameters
    ----------
    sinks : Sequence[Ending]
        The files.
    records : socket.socket
        Non-blocking inlet of the queue.
    """

    def __init__(self, sinks: Sequence[Ending], records: socket.socket) -> None:
        self._sinks = sinks
        self._records = records
        self._buffer = memoryview(bytearray(LARGEST))
        self._flushed = 0.0
        self._poll = select.poll()
        self._poll.register(records, select.POLLIN)

    @property
    def recording(self) -> bool:
        """Whether any file is still being written."""
        return any(sink.open for sink in self._sinks)

    def step(self, wait_ms: int) -> bool:
        """Wait for records, at most ``wait_ms``, and write them; tell whether any came."""
        came = False
        if self._poll.poll(wait_ms):
            while (datagram := self._next()) is not None:
                came = True
                for sink in self._sinks:
                    sink.take(datagram)
        now = time.monotonic()
        if now - self._flushed >= FLUSH_PERIOD:
            self._flushed = now
            for sink in self._sinks:
                sink.flush()
        return came

    def close(self) -> None:
        """Write what waits in memory, and close the files."""
        for sink in self._sinks:
            sink.close()

    def _next(self) -> bytes | None:
        try:
            length = self._records.recv_into(self._buffer)
        except BlockingIOError:
            return None
        return bytes(self._buffer[:length])


def decision_log(path: Path, links: Sequence[str]) -> Ending:
    """Return the decision log that is written at the end of ``path``."""
    return Ending(path, "the recording of decisions", lambda path: DecisionFile(path, links))


def run_recording(path: Path) -> Ending:
    """Return the recording of a run at ``path``; where there is one already, because this process died: beside it."""
    from service.run_file import RunFile  # few runs are recorded, and not everybody has the library

    free = next(filter(_empty, _beside(path)), path)
    if free != path:
        _log.warning("%s: holds a recording already; it goes on in %s", path, free)
    return Ending(free, "the recording", RunFile)


def _beside(path: Path) -> list[Path]:
    return [path, *(path.with_name(f"{path.stem}-{number}{path.suffix}") for number in range(2, 1000))]


def _empty(path: Path) -> bool:
    return not path.exists() or path.stat().st_size == 0


def run(sinks: Sequence[Ending], records: socket.socket) -> None:
    """Record until SIGTERM, and then until the loop has fallen silent."""
    stopping = False

    def stop(_signal: int, _frame: object) -> None:
        nonlocal stopping
        stopping = True

    signal.signal(signal.SIGTERM, stop)
    recorder = Recorder(sinks, records)
    while not stopping:
        recorder.step(200)
    while recorder.step(round(1e3 * QUIET)):
        pass
    recorder.close()
