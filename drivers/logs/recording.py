"""Recordings of samples (.mcap): what no other log says, or what was understood once and is to be replayed as it was.

One message is one reading: its data is the JSON of :data:`~drivers.sample.AnyReading` as ``sample/<sensor>`` has it on
Zenoh, ``publish_time`` is when it was measured and ``log_time`` when it was received, nanoseconds on one clock. The
channel's metadata say by which ``link`` it came and which ``source`` said it. A message on another channel is somebody
else's, and is left alone. MCAP is a container with chunks that have checksums: https://mcap.dev/spec
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import BinaryIO

import msgspec
import zstandard
from mcap.exceptions import McapError
from mcap.records import Channel, Chunk, McapRecord, Message
from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk
from mcap.writer import Writer

from drivers.foreign import MalformedSample, decode
from drivers.sample import AnyReading, LinkReport, Sample

ENCODING = "json"
SCHEMA = "beliefd.Reading"
TOPIC = "sample"
LARGEST_RECORD = 1 << 28
CHUNK = 1 << 16
"""Bytes of a chunk, uncompressed: what one damaged byte costs."""

_LATEST = 1 << 62
_BROKEN: tuple[type[Exception], ...] = (
    McapError,
    CRCValidationError,
    zstandard.ZstdError,
    struct.error,
    UnicodeDecodeError,
    ValueError,
    MemoryError,
    OverflowError,
    RuntimeError,
)
_encoder = msgspec.json.Encoder()


def write(path: Path, samples: Iterable[Sample]) -> int:
    """Write samples, in the order of their arrival, and return how many.

    Raises
    ------
    OSError
        The file cannot be written.
    """
    count = 0
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=CHUNK)
        writer.start(library="beliefd")
        schema = writer.register_schema(
            SCHEMA, "jsonschema", _encoder.encode(msgspec.json.schema(AnyReading))
        )
        channels: dict[tuple[str, str], int] = {}
        for sample in samples:
            said = sample.link, sample.source
            if said not in channels:
                metadata = {"link": sample.link, "source": sample.source}
                topic = f"{TOPIC}/{sample.link}/{sample.source}"
                channels[said] = writer.register_channel(topic, ENCODING, schema, metadata)
            data = _encoder.encode(sample.reading)
            writer.add_message(channels[said], sample.received, data, sample.time, count & 0xFFFFFFFF)
            count += 1
        writer.finish()
    return count


class RecordingReader:
    """Reads an .mcap of samples; see :class:`drivers.logs.LogReader`.

    A damaged chunk is left out and counted; where the container itself is broken or cut off, the reading ends.

    Parameters
    ----------
    path : Path
        The file.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._begin()

    def _begin(self) -> None:
        self._channels: dict[int, Channel] = {}
        self._kinds: Counter[str] = Counter()
        self._malformed: Counter[str] = Counter()
        self._ignored = 0
        self._samples = 0
        self._position = 0
        self._received = 0

    @property
    def size(self) -> int:
        """Bytes of the file."""
        return self._path.stat().st_size

    @property
    def position(self) -> int:
        """Bytes read so far."""
        return self._position

    def __iter__(self) -> Iterator[Sample]:
        """Read from the start, in the order of the file.

        Raises
        ------
        OSError
            The file cannot be read.
        """
        self._begin()
        with self._path.open("rb") as file:
            for record in self._records(file):
                if isinstance(record, Channel):
                    self._channels[record.id] = record
                elif isinstance(record, Message):
                    sample = self._sample(record)
                    if sample is not None:
                        yield sample

    def _records(self, file: BinaryIO) -> Iterator[McapRecord]:
        """Yield the records, those in chunks one by one."""
        records = StreamReader(file, emit_chunks=True, record_size_limit=LARGEST_RECORD).records
        while True:
            try:
                record = next(records, None)
            except _BROKEN:
                self._malformed["broken_container"] += 1
                self._malformed["lost_bytes"] += self.size - self._position
                return
            if record is None:
                self._position = self.size
                return
            if isinstance(record, Chunk):
                yield from self._unpacked(record)
            else:
                yield record
            self._position = file.tell()

    def _unpacked(self, chunk: Chunk) -> list[McapRecord]:
        try:
            return breakup_chunk(chunk, validate_crc=True)
        except _BROKEN:
            self._malformed["broken_chunk"] += 1
            self._malformed["lost_bytes"] += len(chunk.data)
            return []

    def _sample(self, message: Message) -> Sample | None:
        channel = self._channels.get(message.channel_id)
        if channel is None:
            self._malformed["unknown_channel"] += 1
            return None
        self._kinds[channel.topic] += 1
        if channel.message_encoding != ENCODING or not channel.topic.startswith(f"{TOPIC}/"):
            self._ignored += 1
            return None
        try:
            reading, _ = decode(message.data)
        except MalformedSample as error:
            self._malformed[f"{channel.topic}.{error}"] += 1
            return None
        if not 0 <= message.publish_time <= message.log_time <= _LATEST:
            self._malformed[f"{channel.topic}.time"] += 1
            return None
        self._received = max(self._received, message.log_time)
        self._samples += 1
        link = channel.metadata.get("link", TOPIC)
        return Sample(
            message.publish_time, self._received, link, channel.metadata.get("source", channel.topic), reading
        )

    def report(self) -> LinkReport:
        """Return the totals of the iteration so far."""
        return LinkReport(
            TOPIC,
            "up",
            messages=self._kinds.total(),
            samples=self._samples,
            malformed=dict(self._malformed),
            ignored=self._ignored,
            opened=1,
            clock="recorded",
        )

    def kinds(self) -> dict[str, int]:
        """Return how many messages were met on each topic."""
        return dict(self._kinds)
