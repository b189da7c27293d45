"""What goes wrong, and when: windows of time in which a link drops, corrupts, repeats, reorders or delays.

A fault is data; :class:`Faults` applies those of one target, with random numbers of its own, so that the
noise of everything else stays as it was. What it did is counted.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np


@dataclass(frozen=True, slots=True)
class Window:
    """From ``start`` until before ``stop``, seconds since the drive began."""

    start: float = 0.0
    stop: float = math.inf

    def holds(self, time: float) -> bool:
        """Say whether a time lies inside."""
        return self.start <= time < self.stop


class Kind(StrEnum):
    """What happens to a frame or a reading."""

    DROP = "drop"
    CORRUPT = "corrupt"
    REPEAT = "repeat"
    DELAY = "delay"
    REORDER = "reorder"


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault.

    Attributes
    ----------
    target : str
        The link (``mavlink``, ``can``: frames) or the sensor (``wheels``, ``beacons``, …: readings, which can
        be dropped and delayed).
    kind : Kind
        What happens.
    window : Window
        When.
    share : float
        Of the frames or readings in the window.
    delay : float
        Seconds, for :attr:`Kind.DELAY`; the longest time that a frame lags behind others, for
        :attr:`Kind.REORDER` (links only).
    """

    target: str
    kind: Kind
    window: Window = Window()
    share: float = 1.0
    delay: float = 0.2

    def __post_init__(self) -> None:
        """Refuse a share that is none."""
        if not 0.0 <= self.share <= 1.0:
            raise ValueError(f"fault of {self.target}: share needs to be from 0 to 1, got {self.share}")


class Faults:
    """The faults of one target.

    Parameters
    ----------
    target : str
        Whose faults to pick out.
    faults : Iterable[Fault]
        All of the scenario.
    chance : numpy.random.Generator
        Where the luck comes from.
    """

    def __init__(self, target: str, faults: Iterable[Fault], chance: np.random.Generator) -> None:
        self._faults = tuple(fault for fault in faults if fault.target == target)
        self._chance = chance
        self.counts: Counter[Kind] = Counter()

    def strike(self, time: float) -> list[Fault]:
        """Return the faults that happen to a frame or reading at this time, and count them."""
        struck = [
            fault
            for fault in self._faults
            if fault.window.holds(time) and float(self._chance.random()) < fault.share
        ]
        self.counts.update(fault.kind for fault in struck)
        return struck

    def lag(self, fault: Fault) -> float:
        """Draw by how many seconds a reordered frame comes later than it would have."""
        return fault.delay * float(self._chance.random())

    def corrupted(self, data: bytes) -> bytes:
        """Return the bytes with one to three of them changed."""
        spoilt = bytearray(data)
        for _ in range(int(self._chance.integers(1, 4))):
            place = int(self._chance.integers(len(spoilt)))
            spoilt[place] ^= int(self._chance.integers(1, 256))
        return bytes(spoilt)
