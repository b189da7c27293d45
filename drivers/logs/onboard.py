"""What the readers of autopilots' own logs share: messages go through small handlers, and are counted alike.

DataFlash and ULog differ in how a message is found, and in what it says. From there on they are one thing: its
handler makes readings of its fields, what is implausible is counted, and the rest are samples.
"""

from __future__ import annotations

import mmap
from abc import abstractmethod
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import islice
from pathlib import Path
from statistics import median_low
from typing import BinaryIO, Protocol

from drivers.logs.log_file import LogFile, mapped
from drivers.plausibility import implausible
from drivers.sample import AnyReading, LinkReport, Sample

Fields = Mapping[str, float]
ENOUGH_FIXES = 5


class Notes:
    """What a handler counts beside its readings.

    Attributes
    ----------
    malformed, unusable : Counter[str]
        Broken fields; fields by which a sound message says that it has nothing usable: ``MESSAGE.field``.
    """

    def __init__(self) -> None:
        self.malformed: Counter[str] = Counter()
        self.unusable: Counter[str] = Counter()


Handler = Callable[[Fields, Notes], list[AnyReading]]
"""Makes readings of one kind of message. A field that is absent is a KeyError, a count that is none a ValueError."""


class Tally:
    """Makes samples of messages, and the report of it.

    Attributes
    ----------
    faults : Counter[str]
        What was wrong with the stamps.
    ignored : int
        Messages that nobody wanted.
    """

    def __init__(self, link: str) -> None:
        self.faults: Counter[str] = Counter()
        self.ignored = 0
        self._link = link
        self._notes = Notes()
        self._messages = 0
        self._samples = 0

    def samples_of(
        self, source: str, handler: Handler, fields: Fields, measured: int, received: int
    ) -> Iterator[Sample]:
        """Let a handler read a message, and yield what of it is sound; times in nanoseconds."""
        self._messages += 1
        try:
            readings = handler(fields, self._notes)
        except (KeyError, ValueError, OverflowError) as error:
            missing = error.args[0] if isinstance(error, KeyError) else "value"
            self._notes.malformed[f"{source}.{missing}"] += 1
            return
        for reading in readings:
            wrong = implausible(reading)
            if wrong is not None:
                self._notes.malformed[f"{source}.{wrong}"] += 1
                continue
            self._samples += 1
            yield Sample(measured, received, self._link, source, reading)

    def report(self, damage: Counter[str], clock: str) -> LinkReport:
        """Return the totals so far, with what was damaged in the log, and whose clock its times are."""
        return LinkReport(
            self._link,
            "up",
            messages=self._messages,
            samples=self._samples,
            malformed=dict(damage + self.faults + self._notes.malformed),
            unusable=dict(+self._notes.unusable),
            ignored=self.ignored,
            opened=1,
            clock=clock,
        )


class Messages(Protocol):
    """The messages of a log under reading."""

    @property
    def faults(self) -> Counter[str]:
        """What was damaged, by kind."""
        ...

    @property
    def kinds(self) -> Counter[str]:
        """Messages by name."""
        ...

    @property
    def position(self) -> int:
        """Bytes read."""
        ...


class OnboardReader(LogFile):
    """Reads a log that an autopilot wrote; see :class:`drivers.logs.LogReader`.

    Parameters
    ----------
    path : Path
        The file.
    link_name : str
        What the samples name as their link.

    Attributes
    ----------
    log : Messages or None
        What :meth:`samples` reads, once it has begun.
    base : int or None
        Unix time less time since boot, ns, where a receiver knew it; without it the clock is the time since boot.
    """

    clock = ""
    """What the log's clock is where ``base`` is known."""

    def __init__(self, path: Path, link_name: str) -> None:
        self._link = link_name
        self.log: Messages | None = None
        super().__init__(path)

    def begin(self) -> None:
        """Forget the log, and what was counted."""
        self.log = None
        self.base: int | None = None
        self.tally = Tally(self._link)

    @property
    def position(self) -> int:
        """Bytes read so far."""
        return 0 if self.log is None else self.log.position

    def read(self, file: BinaryIO) -> Iterator[Sample]:
        """Yield the samples in the order of the log."""
        for data in mapped(file):
            yield from self.samples(data)

    @abstractmethod
    def samples(self, data: mmap.mmap) -> Iterator[Sample]:
        """Yield the samples of a log that holds anything."""

    def report(self) -> LinkReport:
        """Return the totals of the iteration so far."""
        damage = Counter[str]() if self.log is None else self.log.faults
        return self.tally.report(damage, "boot" if self.base is None else self.clock)

    def kinds(self) -> dict[str, int]:
        """Return how many messages of each kind were met, wanted or not."""
        return {} if self.log is None else dict(self.log.kinds)


def settled(bases: Iterable[int]) -> int | None:
    """Return the middle one of what the first fixes say; ``None`` where there is none."""
    first = list(islice(bases, ENOUGH_FIXES))
    return median_low(first) if first else None
