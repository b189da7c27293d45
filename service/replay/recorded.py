"""The recording of a run, tick by tick: the same samples in the same portions, orders and decisions, on the same clock.

A loop that was started anew while it was recorded began another run; the longest is replayed. Where something is
missing (the recorder's queue was full, a chunk is damaged, the file is cut off), the ticks that are there are given
what is there, and what is missing is counted.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
from pydantic import ValidationError

from drivers.sample import LinkReport, Sample
from service.checkpoint import CheckpointError, Kept, as_it_was
from service.config import Configuration, Start
from service.decisions import Decided
from service.records import DECISION_TOPIC, ESTIMATE_TOPIC, ORDER_TOPIC, RUN_TOPIC, Begun
from service.replay.ticks import Tick

if TYPE_CHECKING:
    from drivers.logs import LogReader
    from drivers.logs.recording import Entry, RecordingReader


class RecordedRunError(Exception):
    """The recording holds a run that cannot be replayed as it was; the text says why."""


@dataclass(frozen=True)
class RecordedRun:
    """One run of a recording.

    Attributes
    ----------
    path : Path
        The file.
    begun : Begun
        What the loop began with.
    number : int
        Which of the file's runs it is, from 0.
    ticks : int
        How many of its ticks there are.
    of : int
        How many runs the file holds.
    """

    path: Path
    begun: Begun
    number: int
    ticks: int
    of: int

    def configuration(self) -> Configuration:
        """Return what the daemon was configured with.

        Raises
        ------
        RecordedRunError
            This version does not understand it.
        """
        try:
            return Configuration.model_validate(self.begun.configuration)
        except ValidationError as error:
            raise RecordedRunError(
                f"{self.path}: was recorded by beliefd {self.begun.version}, whose configuration this version does not "
                f"understand ({error.error_count()} errors); --config says with which to replay its samples"
            ) from error

    def kept(self, configuration: Configuration) -> Kept | None:
        """Return the checkpoint from which the belief went on, if it did.

        Raises
        ------
        RecordedRunError
            It cannot be read.
        """
        try:
            return as_it_was(configuration, self.begun.checkpoint) if self.begun.checkpoint else None
        except CheckpointError as error:
            raise RecordedRunError(f"{self.path}: the checkpoint in it {error}") from error


def recorded_ticks(run: RecordedRun, reader: LogReader) -> RecordedTicks:
    """Return the ticks of a run, by the reader of its file."""
    from drivers.logs.recording import RecordingReader

    assert isinstance(reader, RecordingReader), f"{run.path} was a recording when it was looked into"
    return RecordedTicks(run, reader)


def run_in(path: Path) -> RecordedRun | None:
    """Return the longest run that a recording holds; ``None`` where it holds none: its samples are of somebody else.

    Raises
    ------
    OSError
        It cannot be read.
    """
    from drivers.logs.recording import RecordingReader

    begun: list[Begun] = []
    ticks: list[int] = []
    for entry in RecordingReader(path).entries():
        if entry.topic == RUN_TOPIC:
            beginning = _beginning(entry)
            if beginning is not None:
                begun.append(beginning)
                ticks.append(0)
        elif entry.topic == DECISION_TOPIC and ticks:
            ticks[-1] += 1
    if not any(ticks):
        return None
    longest = ticks.index(max(ticks))
    return RecordedRun(path, begun[longest], longest, ticks[longest], len(ticks))


def _beginning(entry: Entry) -> Begun | None:
    try:
        return msgspec.json.decode(entry.data, type=Begun)
    except msgspec.MsgspecError:
        return None


@dataclass
class _Gathering:
    """What has come of the tick under way."""

    samples: list[Sample] = field(default_factory=list[Sample])
    orders: list[Start] = field(default_factory=list[Start])
    published: bytes = b""


class RecordedTicks:
    """The ticks of a recorded run; see :class:`drivers.logs.LogReader` for what it has of one.

    Parameters
    ----------
    run : RecordedRun
        Which.
    reader : RecordingReader
        Of its file.
    """

    def __init__(self, run: RecordedRun, reader: RecordingReader) -> None:
        self._run = run
        self._reader = reader
        self._missing: Counter[str] = Counter()

    def ticks(self, seen: Callable[[Sample], bool]) -> Iterator[Tick]:
        """Read from the start; of the samples a tick is given those that are ``seen``."""
        gathered, expected = _Gathering(), 0
        for entry in self._entries():
            if entry.topic != DECISION_TOPIC:
                self._gather(entry, gathered)
                continue
            decision = self._decision(entry)
            if decision is None:
                continue
            self._missing["missing_ticks"] += max(0, decision.tick - expected)
            self._missing["missing_samples"] += max(0, sum(decision.taken) - len(gathered.samples))
            expected = decision.tick + 1
            yield Tick(
                decision.now,
                decision.unix,
                [sample for sample in gathered.samples if seen(sample)],
                decision.afforded,
                decision.course(),
                gathered.orders,
                gathered.published,
            )
            gathered = _Gathering()
        self._missing["missing_ticks"] += max(0, self._run.ticks - expected)

    def report(self) -> LinkReport:
        """Return the totals so far: what the file had lost, and what the run's ticks missed."""
        report = self._reader.report()
        return msgspec.structs.replace(report, malformed=report.malformed | dict(+self._missing))

    def _entries(self) -> Iterator[Entry]:
        """Yield what belongs to the run."""
        number = -1
        for entry in self._reader.entries():
            if entry.topic == RUN_TOPIC:
                number += _beginning(entry) is not None
            elif number == self._run.number:
                yield entry
            elif number > self._run.number:
                return

    def _gather(self, entry: Entry, gathered: _Gathering) -> None:
        if entry.is_reading:
            sample = self._reader.sample(entry)
            if sample is not None:
                gathered.samples.append(_on_the_loops_clock(sample, self._run.begun.shift))
        elif entry.topic == ESTIMATE_TOPIC:
            gathered.published = entry.data
        elif entry.topic == ORDER_TOPIC:
            try:
                gathered.orders.append(Start.model_validate_json(entry.data))
            except ValidationError:
                self._missing["missing_orders"] += 1

    def _decision(self, entry: Entry) -> Decided | None:
        """Return a decision; ``None``, and its tick counts as missing, if it is none."""
        try:
            decision = msgspec.json.decode(entry.data, type=Decided)
            decision.course()
        except (msgspec.MsgspecError, ValueError):
            return None
        return decision


def _on_the_loops_clock(sample: Sample, shift: int) -> Sample:
    """Return a sample of the file as the loop had it."""
    return Sample(sample.time - shift, sample.received - shift, sample.link, sample.source, sample.reading)
