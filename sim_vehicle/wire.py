"""The way of a frame to whoever listens: it takes time, in order, and things happen to it on the way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from sim_vehicle.faults import Fault, Faults, Kind

FrameT = TypeVar("FrameT")


@dataclass(frozen=True, slots=True)
class WireSettings:
    """Facts of one link.

    Attributes
    ----------
    latency : float
        Least time on the way, seconds.
    jitter : float
        Mean of the further delay (two exponential stages: a gamma distribution of shape 2), seconds.
    loss : float
        Share of frames that are lost.
    spacing : float
        Least time between two arrivals, seconds: what one frame occupies the wire.
    """

    latency: float = 0.002
    jitter: float = 0.0
    loss: float = 0.0
    spacing: float = 0.0


class Arrival(NamedTuple, Generic[FrameT]):
    """A frame and when it arrives, seconds since the drive began."""

    time: float
    frame: FrameT


class Wire:
    """One link's delay and losses; frames arrive in the order in which they were handed in, unless reordered.

    Parameters
    ----------
    settings : WireSettings
        The link's facts.
    faults : Faults
        What happens to its frames beyond that.
    chance : numpy.random.Generator
        Of this link.
    """

    def __init__(self, settings: WireSettings, faults: Faults, chance: np.random.Generator) -> None:
        self._settings = settings
        self._chance = chance
        self._last = 0.0
        self.faults = faults
        self.sent = 0
        self.lost = 0

    def carry(self, time: float, frame: bytes) -> list[Arrival[bytes]]:
        """Return the arrivals of one frame sent at ``time``: none, one, or two of the same."""
        settings = self._settings
        self.sent += 1
        further, luck = float(self._chance.gamma(2.0)), float(self._chance.random())
        struck = {fault.kind: fault for fault in self.faults.strike(time)}
        if Kind.DROP in struck or luck < settings.loss:
            self.lost += 1
            return []
        delay = settings.latency + 0.5 * settings.jitter * further
        if Kind.DELAY in struck:
            delay += struck[Kind.DELAY].delay
        if Kind.CORRUPT in struck:
            frame = self.faults.corrupted(frame)
        return [Arrival(self._arrival(time + delay, struck), frame)] * (2 if Kind.REPEAT in struck else 1)

    def _arrival(self, earliest: float, struck: dict[Kind, Fault]) -> float:
        if Kind.REORDER in struck:
            # Whoever lags lets the others pass: it holds up nobody.
            return earliest + self.faults.lag(struck[Kind.REORDER])
        self._last = max(earliest, self._last + self._settings.spacing)
        return self._last
