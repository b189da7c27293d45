"""The recording of a run (.mcap): samples as the loop took them, orders, estimates, decisions, and what it began with.

It is a recording of samples (:mod:`drivers.logs.recording`), so it replays as any log does; by the other channels it is
replayed tick by tick as it was (:mod:`service.replay.recorded`). Its clock is Unix time as it was when the loop began,
and goes on with the monotonic clock from there. The messages of one tick lie together, the decision last.

A chunk is ended every :data:`FLUSH_PERIOD` seconds at the latest, so whoever kills the process takes no more than that.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec

from drivers.logs.recording import Recording
from drivers.logs.recording.writer import ORDER as ORDER_REMARK
from drivers.logs.recording.writer import TAKEN as AS_TAKEN
from drivers.sample import SampleBatch, decode
from service.channels import ESTIMATE
from service.config import Start
from service.decisions import Decided, decided
from service.estimate import Estimate
from service.records import (
    BEGUN,
    DECIDED,
    DECISION_TOPIC,
    ESTIMATE_TOPIC,
    ORDER,
    ORDER_TOPIC,
    RUN_TOPIC,
    TAKEN,
    Begun,
)

CHUNK = 1 << 18
"""Bytes, uncompressed: some seconds. Each costs the index some memory until the file is closed."""

FLUSH_PERIOD = 2.0

_log = logging.getLogger(__name__)


class _When(msgspec.Struct):
    """What of an estimate says when it was."""

    sequence: int
    monotonic_ns: int


_when = msgspec.json.Decoder(_When)


class RunFile:
    """Writes the datagrams of :mod:`service.records` to an .mcap.

    Parameters
    ----------
    path : Path
        An empty file, or one that is to be made.

    Raises
    ------
    OSError
        It cannot be written. So do the methods, and then nothing more can be written.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("wb")
        self._recording = Recording(self._file, CHUNK, {ORDER_REMARK: AS_TAKEN})
        self._shift = time.time_ns() - time.monotonic_ns()
        self._now = self._shift + time.monotonic_ns()
        self._ticks = 0
        self._flushed = time.monotonic()
        schema = msgspec.json.schema
        self._recording.open_channel(RUN_TOPIC, "beliefd.Run", schema(Begun))
        self._recording.open_channel(ESTIMATE_TOPIC, "beliefd.Estimate", schema(Estimate))
        self._recording.open_channel(DECISION_TOPIC, "beliefd.Decision", schema(Decided))
        self._recording.open_channel(ORDER_TOPIC, "beliefd.Start", Start.model_json_schema())
        self._takers: dict[bytes, Callable[[bytes], Any]] = {
            BEGUN: self._begun,
            TAKEN: self._taken,
            ESTIMATE: self._estimate,
            DECIDED: self._decided,
            ORDER: self._order,
        }

    def take(self, datagram: bytes) -> None:
        """Write one record."""
        self._takers[datagram[:1]](datagram)

    def flush(self) -> None:
        """Hand what was taken to the operating system, if the last time is long enough ago."""
        now = time.monotonic()
        if now - self._flushed >= FLUSH_PERIOD:
            self._flushed = now
            self._recording.flush()

    def close(self) -> None:
        """Write the index, and close the file."""
        self._recording.finish()
        self._file.close()
        _log.info(
            "%s: %d ticks and %d samples recorded", self._file.name, self._ticks, self._recording.samples
        )

    def discard(self) -> None:
        """Close the file, whatever cannot be written."""
        self._file.close()

    def _add(self, topic: str, data: bytes, sequence: int) -> None:
        self._recording.add(topic, data, self._now, self._now, sequence)

    def _begun(self, datagram: bytes) -> None:
        data = datagram[len(BEGUN) :]
        self._shift = msgspec.json.decode(data, type=Begun).shift
        self._now = self._shift + time.monotonic_ns()
        self._add(RUN_TOPIC, data, 0)

    def _taken(self, datagram: bytes) -> None:
        batch = decode(memoryview(datagram)[len(TAKEN) :])
        if isinstance(batch, SampleBatch):
            for sample in batch.samples:
                self._recording.add_sample(sample, self._shift)

    def _estimate(self, datagram: bytes) -> None:
        data = datagram[len(ESTIMATE) :]
        when = _when.decode(data)
        self._now = when.monotonic_ns + self._shift
        self._add(ESTIMATE_TOPIC, data, when.sequence)

    def _decided(self, datagram: bytes) -> None:
        decision = decided(datagram)
        self._now = decision.now + self._shift
        self._ticks += 1
        self._add(DECISION_TOPIC, msgspec.json.encode(decision), decision.tick)

    def _order(self, datagram: bytes) -> None:
        self._add(ORDER_TOPIC, datagram[len(ORDER) :], 0)
