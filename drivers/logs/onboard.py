"""What the readers of autopilots' own logs share: messages go through small handlers, and are counted alike.

DataFlash and ULog differ in how a message is found, and in what it says. From there on they are one thing: its
handler makes readings of its fields, what is implausible is counted, and the rest are samples.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping

from drivers.plausibility import implausible
from drivers.sample import AnyReading, LinkReport, Sample

Fields = Mapping[str, float]


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
