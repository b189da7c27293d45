"""Telemetry logs (.tlog): per frame a big-endian Unix time in microseconds and the MAVLink frame as it came.

This is what MAVProxy, QGroundControl and Mission Planner write. A log may be damaged (a bad sector, a full
disk), cut off in the middle of a frame, and its clock may have been set while it was recorded; all of that is
survived and counted.
"""

from __future__ import annotations

import mmap
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from drivers.logs.log_file import LogFile, lost, mapped
from drivers.logs.receive_clock import LARGEST_STAMP, ReceiveClock
from drivers.mavlink.decode import Decoder
from drivers.mavlink.dialect import LAYOUTS
from drivers.mavlink.frames import MARKERS, Fault, Frame, frame_at
from drivers.mavlink.sequence import Sequences
from drivers.mavlink.settings import MavlinkSettings
from drivers.sample import LinkReport, Sample

STAMP = 8


class TlogReader(LogFile):
    """Reads a .tlog through the same decoder as the live link; see :class:`drivers.logs.LogReader`.

    Parameters
    ----------
    path : Path
        The file.
    link_name : str
        What the samples name as their link.
    settings : MavlinkSettings
        As of the live link; ``url`` is not used.
    """

    def __init__(self, path: Path, link_name: str, settings: MavlinkSettings) -> None:
        self._link = link_name
        self._settings = settings
        super().__init__(path)

    def begin(self) -> None:
        """Take a decoder that has heard nothing."""
        self._decoder = Decoder(self._link, self._settings)
        self._sequences = Sequences()
        self._clock: ReceiveClock | None = None
        self._faults: Counter[str] = Counter()
        self._kinds: Counter[int] = Counter()
        self._ahead: tuple[int, int | None] = (-1, None)  # where the next entry begins, and its stamp

    def read(self, file: BinaryIO) -> Iterator[Sample]:
        """Yield the samples in order of arrival."""
        for data in mapped(file):
            yield from self._samples(data)

    def _samples(self, data: mmap.mmap) -> Iterator[Sample]:
        decoder, wanted, kinds = self._decoder, self._decoder.wanted, self._kinds
        at = 0
        while at < len(data):
            frame = frame_at(data, at + STAMP)
            if not isinstance(frame, Frame) or (frame.layout is None and not _followed(data, at, frame)):
                at = self.done = self._resynchronise(data, at, frame)
                continue
            received = self._received(data, at, frame)
            at = self.done = at + STAMP + len(frame.raw)
            kinds[frame.identifier] += 1
            self._number(frame, received)
            if frame.identifier in wanted:
                yield from decoder.decode(frame.message(), received)
            elif frame.layout is None:
                self._faults[Fault.UNKNOWN] += 1

    def _number(self, frame: Frame, received: int) -> None:
        """Look for a gap before this frame, if it is one of the vehicle's."""
        if frame.layout is None:
            self._sequences.passed(frame)
        elif self._decoder.is_of_vehicle(frame.system, frame.component):
            self._sequences.heard(frame, received)

    def _received(self, data: mmap.mmap, at: int, frame: Frame) -> int:
        """Return when the frame of the entry at ``at`` arrived, nanoseconds."""
        end = at + STAMP + len(frame.raw)
        if self._clock is None:
            self._clock = ReceiveClock(_stamps(data, at, 3))
        following = _stamp(data, end) if end + STAMP <= len(data) else None
        before, stamp = self._ahead
        self._ahead = (end, following)
        return self._clock.read(stamp if before == at and stamp is not None else _stamp(data, at), following)

    def _resynchronise(self, data: mmap.mmap, at: int, fault: Frame | Fault) -> int:
        """Return where the next good entry starts; count the stretch once, and its bytes."""
        search = at + STAMP + 1
        end = len(data)
        while found := MARKERS.search(data, search):
            frame = frame_at(data, found.start())
            if isinstance(frame, Frame) and frame.layout is not None:
                end = found.start() - STAMP
                break
            search = found.start() + 1
        return lost(self._faults, fault if isinstance(fault, Fault) else Fault.UNKNOWN, at, end)

    def report(self) -> LinkReport:
        """Return the totals of the iteration so far."""
        decoder = self._decoder
        clocks = decoder.main_clocks
        wanted = sum(count for identifier, count in self._kinds.items() if identifier in decoder.wanted)
        stamps = Counter[str]() if self._clock is None else self._clock.faults
        unwanted = self._kinds.total() - wanted - self._faults[Fault.UNKNOWN]
        return LinkReport(
            self._link,
            "up",
            messages=decoder.messages,
            samples=decoder.samples,
            malformed=dict(self._faults + stamps + decoder.malformed),
            unusable=dict(decoder.unusable),
            ignored=unwanted + decoder.ignored.total(),
            lost=self._sequences.lost,
            opened=1,
            clock=clocks.boot.method if clocks else "",
            offset=clocks.boot.offset if clocks else None,
            jitter=clocks.boot.jitter if clocks else None,
        )

    def kinds(self) -> dict[str, int]:
        """Return how many messages of each kind were met, wanted or not; unknown ones by id."""
        return {
            LAYOUTS[identifier].name if identifier in LAYOUTS else str(identifier): count
            for identifier, count in self._kinds.items()
        }


def _followed(data: mmap.mmap, at: int, frame: Frame) -> bool:
    """Whether an unknown message is believed: the log ends after it, or an entry follows."""
    marker = at + STAMP + len(frame.raw) + STAMP
    return marker - STAMP == len(data) or data[marker : marker + 1] in (b"\xfd", b"\xfe")


def _stamp(data: mmap.mmap, at: int) -> int:
    return min(int.from_bytes(data[at : at + STAMP], "big"), LARGEST_STAMP)


def _stamps(data: mmap.mmap, at: int, count: int) -> list[int]:
    """Return the stamps of up to ``count`` entries that follow one another from ``at``."""
    stamps: list[int] = []
    while len(stamps) < count and isinstance(frame := frame_at(data, at + STAMP), Frame):
        stamps.append(_stamp(data, at))
        at += STAMP + len(frame.raw)
    return stamps
