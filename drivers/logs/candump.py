"""Recordings of can-utils: ``candump -L``, plain or gzipped, through the decoder of the live bus.

One line is one frame: ``(1700000000.123456) can0 18042F7B#0011223344556677``. After a second ``#`` stands the
flags digit of a CAN FD frame; ``#R`` is a remote frame; a trailing ``R`` or ``T`` says received or
transmitted. An identifier with more than three digits has 29 bits; above them SocketCAN keeps the flag of an
error frame.
"""

from __future__ import annotations

import gzip
import re
import zlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from drivers.can import CanFrame, CanSettings, Decoder
from drivers.can.traffic import Traffic
from drivers.sample import LinkReport, Sample

_LINE = re.compile(
    rb"\((?P<seconds>\d{1,11})\.(?P<fraction>\d{1,9})\)\s+(?P<channel>\S{1,64})\s+"
    rb"(?P<identifier>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(?:#(?P<flags>[0-9A-Fa-f]))?"
    rb"(?:(?P<remote>[Rr][0-9A-Fa-f]?)|(?P<data>(?:[0-9A-Fa-f]{2})*))(?:\s+[RrTt])?\s*"
)
_LONGEST_LINE = 512
_MOST_CHANNELS = 16
_ERROR_FRAME = 0x20000000
_EXTENDED_MASK = 0x1FFFFFFF
_STANDARD_DIGITS = 3
_LARGEST_CLASSIC = 8
_LARGEST_FLEXIBLE = 64


class LoggedFrame(NamedTuple):
    """One line: when (Unix time, nanoseconds), on which bus, and the frame."""

    time_ns: int
    channel: str
    frame: CanFrame


def parse(line: bytes) -> LoggedFrame | None:
    """Return the frame of one line of ``candump -L``, or ``None`` for a remote frame.

    Raises
    ------
    ValueError
        The line is damaged (``bad_line``) or records an error of the bus (``error_frame``).
    """
    match = _LINE.fullmatch(line)
    if match is None:
        raise ValueError("bad_line")
    identifier = int(match["identifier"], 16)
    if identifier & _ERROR_FRAME:
        raise ValueError("error_frame")
    if match["remote"] is not None:
        return None
    data = bytes.fromhex(match["data"].decode())
    flexible = match["flags"] is not None
    if len(data) > (_LARGEST_FLEXIBLE if flexible else _LARGEST_CLASSIC):
        raise ValueError("bad_line")
    extended = len(match["identifier"]) > _STANDARD_DIGITS
    time_ns = int(match["seconds"]) * 1_000_000_000 + int(match["fraction"].ljust(9, b"0"))
    frame = CanFrame(identifier & _EXTENDED_MASK, data, extended, flexible)
    return LoggedFrame(time_ns, match["channel"].decode(errors="replace"), frame)


class CandumpReader:
    """The samples of one recording, on its own clock (Unix time of its stamps, in nanoseconds).

    Every bus of the recording is replayed as the one link, each reassembled for itself, whatever it was
    called where it was recorded.

    Parameters
    ----------
    path : Path
        ``.log`` or ``.log.gz``; the content decides, not the name.
    link_name : str
        Name of the link, for the samples' envelope.
    settings : CanSettings
        Of the link; the interface and channel play no part.

    Raises
    ------
    OSError
        The file does not exist.
    """

    def __init__(self, path: Path, link_name: str, settings: CanSettings) -> None:
        self._path = path
        self._link = link_name
        self._settings = settings
        self._size = path.stat().st_size
        self._file: BinaryIO | None = None
        self._begin()

    def _begin(self) -> None:
        self._decoders: dict[str, Decoder] = {}
        self._traffic = Traffic()
        self._refused: Counter[str] = Counter()
        self._samples = 0
        self._skipped = 0
        self._latest_ns = 0

    @property
    def size(self) -> int:
        """Bytes of the file, as it lies on the disk."""
        return self._size

    @property
    def position(self) -> int:
        """Bytes of the file read so far: ``position / size`` is the progress."""
        if self._file is None:
            return 0
        return self._size if self._file.closed else self._file.tell()

    def report(self) -> LinkReport:
        """Return the totals of the iteration so far."""
        decoders = self._decoders.values()
        return LinkReport(
            link=self._link,
            state="up",
            messages=sum(decoder.messages for decoder in decoders),
            samples=self._samples,
            malformed=dict(sum((decoder.malformed for decoder in decoders), self._refused.copy())),
            unusable=dict(sum((decoder.unusable for decoder in decoders), Counter[str]())),
            ignored=self._skipped + sum(decoder.ignored for decoder in decoders),
            opened=1,
        )

    def kinds(self) -> dict[str, int]:
        """Return how many messages of each kind were met, also of those that no one wants."""
        return self._traffic.kinds()

    def __iter__(self) -> Iterator[Sample]:
        """Yield the samples in the order of the recording; a damaged line is counted and ends nothing."""
        self._begin()
        for time_ns, channel, frame in self._frames():
            decoder = self._decoders.get(channel)
            if decoder is None:
                if len(self._decoders) == _MOST_CHANNELS:
                    self._refused["too_many_channels"] += 1
                    continue
                decoder = self._decoders[channel] = Decoder(self._link, self._settings)
            self._traffic.count(frame)
            # The stamps of several buses may cross by microseconds; the receive clock never goes back.
            self._latest_ns = max(self._latest_ns, time_ns)
            for sample in decoder.decode(frame, self._latest_ns):
                self._samples += 1
                yield sample

    def _frames(self) -> Iterator[LoggedFrame]:
        for line in self._lines():
            if not line.strip():
                continue
            try:
                logged = parse(line)
            except ValueError as error:
                self._refused[str(error)] += 1
                continue
            if logged is None:
                self._skipped += 1
                continue
            yield logged

    def _lines(self) -> Iterator[bytes]:
        with self._path.open("rb") as file:
            self._file = file
            zipped = file.peek(2)[:2] == b"\x1f\x8b"
            text: BinaryIO = gzip.GzipFile(fileobj=file) if zipped else file  # pyright: ignore[reportAssignmentType]
            try:
                yield from iter(lambda: text.readline(_LONGEST_LINE), b"")
            except (EOFError, gzip.BadGzipFile, zlib.error):
                self._refused["truncated_file"] += 1
