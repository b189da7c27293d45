"""Writing recordings of samples, whole ones and such as grow while a vehicle drives."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import BinaryIO

import msgspec
from mcap.writer import Writer

from drivers.sample import AnyReading, Sample

ENCODING = "json"
SCHEMA = "beliefd.Reading"
TOPIC = "sample"
LINK, SOURCE, ORDER = "link", "source", "order"
"""Names of a channel's metadata."""

TAKEN = "taken"
"""The order of a recording whose samples lie as the loop took them, link by link; times may run back a little."""

CHUNK = 1 << 16
"""Bytes of a chunk, uncompressed: what one damaged byte costs."""

_LARGEST_SEQUENCE = 0xFFFFFFFF
_encoder = msgspec.json.Encoder()


class Recording:
    """An .mcap under construction: zstd chunks, JSON messages, a JSON schema for every channel.

    Parameters
    ----------
    file : BinaryIO
        Open for writing, at its start; it is not closed here.
    chunk : int
        Bytes of a chunk, uncompressed.
    remarks : Mapping[str, str]
        Metadata of every channel of samples.
    """

    def __init__(self, file: BinaryIO, chunk: int = CHUNK, remarks: Mapping[str, str] | None = None) -> None:
        self._writer = Writer(file, chunk_size=chunk)
        self._writer.start(library="beliefd")
        self._remarks = dict(remarks or {})
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._said: dict[tuple[str, str], int] = {}
        self.samples = 0
        """Samples written so far."""

    def add_sample(self, sample: Sample, shift: int = 0) -> None:
        """Write one sample, its times later by ``shift`` nanoseconds: what the recording's clock is ahead."""
        said = sample.link, sample.source
        channel = self._said.get(said)
        if channel is None:
            channel = self._said[said] = self._channel_of(sample)
        data = _encoder.encode(sample.reading)
        sequence = self.samples & _LARGEST_SEQUENCE
        self._writer.add_message(channel, sample.received + shift, data, sample.time + shift, sequence)
        self.samples += 1

    def _channel_of(self, sample: Sample) -> int:
        schema = self._schemas.get(SCHEMA)
        if schema is None:
            schema = self._registered(SCHEMA, msgspec.json.schema(AnyReading))
        metadata = {LINK: sample.link, SOURCE: sample.source} | self._remarks
        topic = f"{TOPIC}/{sample.link}/{sample.source}"
        return self._writer.register_channel(topic, ENCODING, schema, metadata)

    def open_channel(self, topic: str, name: str, schema: Mapping[str, object]) -> None:
        """Make a channel of another kind: its topic, and the name and JSON schema of its messages."""
        self._channels[topic] = self._writer.register_channel(topic, ENCODING, self._registered(name, schema))

    def _registered(self, name: str, schema: Mapping[str, object]) -> int:
        number = self._writer.register_schema(name, "jsonschema", _encoder.encode(schema))
        self._schemas[name] = number
        return number

    def add(self, topic: str, data: bytes, time: int, published: int, sequence: int) -> None:
        """Write one message on a channel that was opened; times in nanoseconds."""
        self._writer.add_message(self._channels[topic], time, data, published, sequence & _LARGEST_SEQUENCE)

    def flush(self) -> None:
        """End the chunk under way, and hand everything to the operating system."""
        self._writer.flush()

    def finish(self) -> None:
        """Write what is left, and the index; nothing can be added afterwards."""
        self._writer.finish()


def write(path: Path, samples: Iterable[Sample]) -> int:
    """Write samples, in the order of their arrival, and return how many.

    Raises
    ------
    OSError
        The file cannot be written.
    """
    with path.open("wb") as file:
        recording = Recording(file)
        for sample in samples:
            recording.add_sample(sample)
        recording.finish()
    return recording.samples
