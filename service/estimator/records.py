"""What became of every sensor's readings, by name, for those who ask how the sensors are."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

from drivers.sample import SECOND
from service.estimate import SensorStatus

MOST_RECORDS = 256
OTHERS = "others"
"""Beacons' numbers come from outside: beyond this many names their readings are recorded under one."""


@dataclass
class SensorRecord:
    """What became of one sensor's readings."""

    accepted: int = 0
    refused: Counter[str] = field(default_factory=Counter[str])
    innovation: float | None = None
    last: int | None = None
    arrivals: int = 0

    def judge(self, outlier: bool) -> None:
        """Count a reading that was weighed: refused as an outlier, which moves next to nothing, or accepted."""
        if outlier:
            self.refused["outlier"] += 1
        else:
            self.accepted += 1


class SensorRecords:
    """The records of all sensors, bounded in number: names hold beacon numbers, and those come from outside."""

    def __init__(self) -> None:
        self._records: dict[str, SensorRecord] = {}
        self._told: int | None = None

    def of(self, name: str) -> SensorRecord:
        """Return the record of ``name``, a new one the first time."""
        if name not in self._records and len(self._records) >= MOST_RECORDS:
            name = OTHERS
        return self._records.setdefault(name, SensorRecord())

    def statuses(self, now: int, trust: Callable[[str], float | None] | None = None) -> list[SensorStatus]:
        """Return every record as it is published; the rates are over the time since the last call."""
        elapsed = SECOND if self._told is None else max(1, now - self._told)
        self._told = now
        statuses = [
            SensorStatus(
                name,
                round(record.arrivals * SECOND / elapsed, 2),
                None if trust is None else trust(name),
                record.accepted,
                dict(record.refused),
                record.innovation,
                None if record.last is None else (now - record.last) / SECOND,
            )
            for name, record in sorted(self._records.items())
        ]
        for record in self._records.values():
            record.arrivals = 0
        return statuses
