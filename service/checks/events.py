"""What befell a drive and when: the table that a simulated drive has beside its truth."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import NamedTuple

COLUMNS = ("time_s", "event")


class Event(NamedTuple):
    """Something that happened: Unix seconds, and a word for it."""

    time: float
    name: str


def read_events(path: Path) -> tuple[Event, ...]:
    """Read a table of events: CSV with the columns ``time_s,event``.

    Raises
    ------
    ValueError
        A column is missing or a time is no number; the text says where.
    """
    events: list[Event] = []
    with path.open(newline="") as file:
        reader = csv.DictReader(file)
        missing = [name for name in COLUMNS if name not in (reader.fieldnames or ())]
        if missing:
            raise ValueError(
                f"{path}: a table of events needs the columns {', '.join(COLUMNS)}; missing: {', '.join(missing)}"
            )
        for row in reader:
            try:
                time = float(row["time_s"])
            except (TypeError, ValueError):
                time = math.nan
            if not math.isfinite(time):
                raise ValueError(f"{path}, line {reader.line_num}: time_s must be a number")
            events.append(Event(time, row["event"]))
    return tuple(events)
