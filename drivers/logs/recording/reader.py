"""Reading recordings of samples, whatever became of them since they were written."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

import msgspec
import zstandard
from mcap.exceptions import McapError
from mcap.records import Channel, Chunk, McapRecord, Message
from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk

from drivers.foreign import MalformedSample, decode
from drivers.logs.log_file import LogFile, lost
from drivers.logs.recording.writer import ENCODING, LINK, ORDER, SOURCE, TAKEN, TOPIC
from drivers.sample import SECOND, LinkReport, Sample

LARGEST_RECORD = 1 << 28
SETTLING = SECOND
"""Nanoseconds that a sample may have been measured after it came, where a live clock mapping settled."""

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


class Entry(NamedTuple):
    """One message of a recording, and what its channel says of it; times in nanoseconds.

    Attributes
    ----------
    link, source : str
        By whom it came, where it is a reading.
    taken : bool
        Whether it lies where the loop took it.
    """

    topic: str
    log_time: int
    publish_time: int
    data: bytes
    link: str
    source: str
    taken: bool

    @property
    def is_reading(self) -> bool:
        """Whether it is on a channel of readings."""
        return self.topic.startswith(f"{TOPIC}/")


class RecordingReader(LogFile):
    """Reads an .mcap of samples; see :class:`drivers.logs.LogReader`.

    A damaged chunk is left out and counted; where the container itself is broken or cut off, the reading ends.

    Parameters
    ----------
    path : Path
        The file.
    """

    def begin(self) -> None:
        """Forget the channels, and what was counted."""
        self._channels: dict[int, Channel] = {}
        self._kinds: Counter[str] = Counter()
        self._malformed: Counter[str] = Counter()
        self._ignored = 0
        self._samples = 0
        self._received = 0

    def read(self, file: BinaryIO) -> Iterator[Sample]:
        """Yield the samples in the order of the file."""
        for entry in self._entries(file):
            if not entry.is_reading:
                self._ignored += 1
                continue
            sample = self.sample(entry)
            if sample is not None:
                self._received = max(self._received, sample.received)
                in_line = sample.received == self._received
                yield sample if in_line else msgspec.structs.replace(sample, received=self._received)

    def entries(self) -> Iterator[Entry]:
        """Read from the start: every JSON message, in the order of the file.

        Raises
        ------
        OSError
            The file cannot be read.
        """
        self.begin()
        with self.path.open("rb") as file:
            yield from self._entries(file)

    def _entries(self, file: BinaryIO) -> Iterator[Entry]:
        for record in self._records(file):
            if isinstance(record, Channel):
                self._channels[record.id] = record
            elif isinstance(record, Message):
                entry = self._entry(record)
                if entry is not None:
                    yield entry

    def _records(self, file: BinaryIO) -> Iterator[McapRecord]:
        """Yield the records, those in chunks one by one."""
        records = StreamReader(file, emit_chunks=True, record_size_limit=LARGEST_RECORD).records
        while True:
            try:
                record = next(records, None)
            except _BROKEN:
                lost(self._malformed, "broken_container", self.done, self.size)
                return
            if record is None:
                self.done = self.size
                return
            if isinstance(record, Chunk):
                yield from self._unpacked(record)
            else:
                yield record
            self.done = file.tell()

    def _unpacked(self, chunk: Chunk) -> list[McapRecord]:
        try:
            return breakup_chunk(chunk, validate_crc=True)
        except _BROKEN:
            lost(self._malformed, "broken_chunk", 0, len(chunk.data))
            return []

    def _entry(self, message: Message) -> Entry | None:
        channel = self._channels.get(message.channel_id)
        if channel is None:
            self._malformed["unknown_channel"] += 1
            return None
        topic, metadata = channel.topic, channel.metadata
        self._kinds[topic] += 1
        if channel.message_encoding != ENCODING:
            self._ignored += 1
            return None
        link, source = metadata.get(LINK, TOPIC), metadata.get(SOURCE, topic)
        taken = metadata.get(ORDER) == TAKEN
        return Entry(topic, message.log_time, message.publish_time, message.data, link, source, taken)

    def sample(self, entry: Entry) -> Sample | None:
        """Return the sample that an entry is, with the times in the file; ``None``, and counted, if it is none."""
        try:
            reading, _ = decode(entry.data)
        except MalformedSample as error:
            self._malformed[f"{entry.topic}.{error}"] += 1
            return None
        latest = entry.log_time + (SETTLING if entry.taken else 0)
        if not 0 <= entry.publish_time <= latest <= _LATEST:
            self._malformed[f"{entry.topic}.time"] += 1
            return None
        self._samples += 1
        return Sample(entry.publish_time, entry.log_time, entry.link, entry.source, reading)

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
