"""DataFlash logs as ArduPilot writes them: ``A3 95``, the number of the message, its fields; no checksum.

A message is believed when another one, or the end, follows it at its length. What lies between, after damage, is
searched for the next pair; the stretch is counted once, and its bytes. Times are microseconds since boot; where a
receiver had a fix, the log's clock is GPS time (as Unix time), else it is the time since boot.
"""

from __future__ import annotations

import mmap
from collections import Counter
from collections.abc import Iterator

from drivers.logs.dataflash.layout import FMT, HEADER, HEADER_LENGTH, Layout, Layouts
from drivers.logs.dataflash.records import FIX_3D, USUAL, handlers, source_of
from drivers.logs.log_file import lost
from drivers.logs.onboard import Fields, Handler, OnboardReader, settled
from drivers.logs.receive_clock import LARGEST_STAMP, on_clock
from drivers.sample import Sample

DEFINITIONS = frozenset({"FMT", "FMTU", "UNIT", "MULT"})
GPS_EPOCH = 315_964_800  # Unix seconds of 1980-01-06
WEEK = 604_800
FIRST_WEEK = 1000  # 1999; a smaller one comes from a receiver that does not know the date
LEAP_SECONDS = ((1930, 18), (1851, 17), (1695, 16), (1512, 15), (0, 14))
"""GPS ahead of UTC from that week on."""


class Log:
    """The messages of a log, in order, with what was damaged.

    Attributes
    ----------
    layouts : Layouts
        What the log has said of itself up to where it was read.
    faults : Counter[str]
        ``bad_header``: stretches where no message was to be made out; ``lost_bytes`` in them; ``bad_format``: a
        definition that cannot be true.
    kinds : Counter[str]
        Messages by name.
    position : int
        Bytes read.
    """

    def __init__(self, data: mmap.mmap) -> None:
        self._data = data
        self.layouts = Layouts(USUAL)
        self.faults: Counter[str] = Counter()
        self.kinds: Counter[str] = Counter()
        self.position = 0

    def __iter__(self) -> Iterator[tuple[Layout, int]]:
        """Yield layout and place of every message but the definitions, which are learnt."""
        at = 0
        while at < len(self._data):
            layout = self._at(at)
            if layout is None:
                at = self.position = self._resynchronise(at)
                continue
            self.kinds[layout.name] += 1
            if layout.kind == FMT or layout.name in DEFINITIONS:
                self.faults["bad_format"] += not self.layouts.learn(layout, self._data, at)
            else:
                yield layout, at
            at = self.position = at + layout.length

    def _at(self, at: int) -> Layout | None:
        """Return the layout of the message at ``at``, if there is one and something follows it."""
        data = self._data
        if data[at : at + 2] != HEADER or at + HEADER_LENGTH > len(data):
            return None
        layout = self.layouts.known.get(data[at + 2])
        if layout is None:
            return None
        end = at + layout.length
        return layout if data[end : end + 2] == HEADER or end == len(data) else None

    def _resynchronise(self, at: int) -> int:
        """Return where the next good message starts."""
        found = self._data.find(HEADER, at + 1)
        while found >= 0 and self._at(found) is None:
            found = self._data.find(HEADER, found + 1)
        return lost(self.faults, "bad_header", at, found if found >= 0 else len(self._data))


class DataflashReader(OnboardReader):
    """Reads a .bin."""

    clock = "gps"

    def begin(self) -> None:
        """Forget the log, and what its messages have said."""
        super().begin()
        self._handlers: dict[str, Handler] = handlers()

    def samples(self, data: mmap.mmap) -> Iterator[Sample]:
        """Yield the samples in the order of the log."""
        self.base = unix_at_boot(data)
        self.log = log = Log(data)
        for time, (layout, at) in on_clock(self._wanted(log, data), self.tally.faults):
            fields = log.layouts.ready(layout).fields(data, at)
            yield from self._samples_of(layout, fields, time + (self.base or 0))

    def _wanted(self, log: Log, data: mmap.mmap) -> Iterator[tuple[int, tuple[Layout, int]]]:
        """Yield the messages that have a handler, with their stamps."""
        for layout, at in log:
            stamp = layout.stamp(data, at) if layout.name in self._handlers else None
            if stamp is None:
                self.tally.ignored += 1
            else:
                yield min(stamp, LARGEST_STAMP // 2), (layout, at)

    def _samples_of(self, layout: Layout, fields: Fields, time: int) -> Iterator[Sample]:
        source = source_of(layout.name, fields)
        if source is None:
            self.tally.ignored += 1
            return
        yield from self.tally.samples_of(source, self._handlers[source], fields, time, time)


def unix_at_boot(data: mmap.mmap) -> int | None:
    """Return Unix time less time since boot (ns) by the first fixes of a log, ``None`` where there is none."""
    return settled(_bases(data))


def _bases(data: mmap.mmap) -> Iterator[int]:
    log = Log(data)
    for layout, at in log:
        if layout.name != "GPS":
            continue
        stamp = layout.stamp(data, at)
        base = None if stamp is None else _base(log.layouts.ready(layout).fields(data, at), stamp)
        if base is not None:
            yield base


def _base(fields: Fields, stamp: int) -> int | None:
    week, seconds = fields.get("GWk", 0.0), fields.get("GMS", -1.0)
    if fields.get("Status", 0.0) < FIX_3D or not FIRST_WEEK <= week < 10_000 or not 0.0 <= seconds < WEEK:
        return None
    leap = next(ahead for first, ahead in LEAP_SECONDS if week >= first)
    unix = (GPS_EPOCH + int(week) * WEEK - leap) * 1_000_000 + round(seconds * 1e6)
    return (unix - stamp) * 1_000 if stamp <= unix else None
