"""Recordings of CAN buses, whatever their format: frames through the decoder of the live bus.

A format is a function that yields the frames of an open file (:data:`FrameSource`); what it cannot read it counts
and leaves out. Text formats may be gzipped.
"""

from __future__ import annotations

import gzip
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import BinaryIO, NamedTuple

from drivers.can import CanFrame, CanSettings, FrameDecoder, decoder_of
from drivers.logs.log_file import LogFile
from drivers.logs.receive_clock import MICROSECOND, on_clock
from drivers.sample import LinkReport, Sample

LONGEST_LINE = 1024
GZIP = b"\x1f\x8b"
_MOST_CHANNELS = 16


class LoggedFrame(NamedTuple):
    """One frame of a recording: when (nanoseconds), on which bus, and the frame."""

    time_ns: int
    channel: str
    frame: CanFrame


@dataclass
class Tally:
    """What a format met that is no data frame.

    Attributes
    ----------
    refused : Counter[str]
        Damage by kind.
    skipped : int
        What is sound and not wanted: remote frames, remarks, events.
    """

    refused: Counter[str] = field(default_factory=Counter[str])
    skipped: int = 0


FrameSource = Callable[[BinaryIO, Tally], Iterator[LoggedFrame]]
"""Yields the frames of a file, open at its start, and counts what is none; it raises nothing but OSError."""


def lines(file: BinaryIO, tally: Tally) -> Iterator[bytes]:
    """Yield the lines of a text file, plain or gzipped, up to where the compression is damaged.

    A line without an end is cut into pieces of :data:`LONGEST_LINE`.
    """
    zipped = file.read(2) == GZIP
    file.seek(0)
    text: BinaryIO = gzip.GzipFile(fileobj=file) if zipped else file  # pyright: ignore[reportAssignmentType]
    try:
        yield from iter(partial(text.readline, LONGEST_LINE), b"")
    except (EOFError, gzip.BadGzipFile, zlib.error):
        tally.refused["truncated_file"] += 1


class CanLogReader(LogFile):
    """The samples of one recording, on its own clock; see :class:`drivers.logs.LogReader`.

    Every bus of the recording is replayed as the one link, each reassembled for itself, whatever it was
    called where it was recorded.

    Parameters
    ----------
    path : Path
        The file.
    link_name : str
        Name of the link, for the samples' envelope.
    settings : CanSettings
        Of the link; the interface and channel play no part.
    source : FrameSource
        Its format.

    Raises
    ------
    OSError
        The file does not exist.
    ValueError
        The DBC file cannot be used, or a signal is not in it.
    """

    def __init__(self, path: Path, link_name: str, settings: CanSettings, source: FrameSource) -> None:
        self._link = link_name
        self._settings = settings
        self._source = source
        self._file: BinaryIO | None = None
        path.stat()  # now, rather than at the first frame
        super().__init__(path)

    def begin(self) -> None:
        """Take decoders that have heard nothing."""
        self._decoders: dict[str, FrameDecoder] = {}
        self._census = decoder_of(self._link, self._settings).census()
        self._tally = Tally()
        self._samples = 0

    @property
    def position(self) -> int:
        """Bytes of the file read so far, as it lies on the disk: of a gzipped one fewer than were unpacked."""
        if self._file is None:
            return 0
        return self.size if self._file.closed else self._file.tell()

    def report(self) -> LinkReport:
        """Return the totals of the iteration so far."""
        decoders = self._decoders.values()
        return LinkReport(
            link=self._link,
            state="up",
            messages=sum(decoder.messages for decoder in decoders),
            samples=self._samples,
            malformed=dict(sum((decoder.malformed for decoder in decoders), self._tally.refused.copy())),
            unusable=dict(sum((decoder.unusable for decoder in decoders), Counter[str]())),
            ignored=self._tally.skipped + sum(decoder.ignored for decoder in decoders),
            opened=1,
        )

    def kinds(self) -> dict[str, int]:
        """Return how many messages of each kind were met, also of those that no one wants."""
        return self._census.kinds()

    def read(self, file: BinaryIO) -> Iterator[Sample]:
        """Yield the samples in the order of the recording."""
        self._file = file
        for time_ns, (channel, frame) in on_clock(self._stamped(file), self._tally.refused):
            decoder = self._decoders.get(channel)
            if decoder is None:
                if len(self._decoders) == _MOST_CHANNELS:
                    self._tally.refused["too_many_channels"] += 1
                    continue
                decoder = self._decoders[channel] = decoder_of(self._link, self._settings)
            self._census.count(frame)
            for sample in decoder.decode(frame, time_ns):
                self._samples += 1
                yield sample

    def _stamped(self, file: BinaryIO) -> Iterator[tuple[int, tuple[str, CanFrame]]]:
        for time_ns, channel, frame in self._source(file, self._tally):
            yield time_ns // MICROSECOND, (channel, frame)
