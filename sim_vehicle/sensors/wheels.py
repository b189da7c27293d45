"""Wheel encoders: how far the left and the right wheels say that they have rolled, in all.

They read long or short by a scale, spin a little against the ground all the time and a lot now and then, and
count in whole ticks of a counter that goes on from where it was.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sim_vehicle.faults import Window
from sim_vehicle.sensors.cadence import Cadence
from sim_vehicle.sensors.correlated import Wander
from sim_vehicle.world import Truth


@dataclass(frozen=True, slots=True)
class Slip:
    """In this window all wheels spin: they roll further than the ground passes by ``share`` of it."""

    window: Window
    share: float


@dataclass(frozen=True, slots=True)
class WheelSettings:
    """Facts of the encoders.

    Attributes
    ----------
    cadence : Cadence
        When they are read.
    scale : float
        Counted distance over the wheels' distance, common to both sides.
    imbalance : float
        How much longer the left one reads than the right one, as a share.
    tick : float
        Metres per count.
    slip, slip_correlation : float
        Standard deviation of the share of spin against the ground, and how long it lasts (s).
    burst_interval, burst_length, burst_slip : float
        Mean seconds between two bursts of spinning, mean length of one (s), its mean share. 0 as interval:
        none.
    slips : tuple[Slip, ...]
        Spinning that is no matter of chance.
    """

    cadence: Cadence
    scale: float = 1.0
    imbalance: float = 0.0
    tick: float = 0.001
    slip: float = 0.0
    slip_correlation: float = 1.0
    burst_interval: float = 0.0
    burst_length: float = 1.0
    burst_slip: float = 0.2
    slips: tuple[Slip, ...] = ()


@dataclass(frozen=True, slots=True)
class WheelReading:
    """Cumulative metres of the left and the right wheel at ``time``, seconds since the drive began."""

    time: float
    left: float
    right: float


class Wheels:
    """The two encoders of a rover."""

    def __init__(self, settings: WheelSettings, chance: np.random.Generator) -> None:
        self._settings = settings
        self._chance = chance
        self._slips = (
            Wander(settings.slip, settings.slip_correlation, chance),
            Wander(settings.slip, settings.slip_correlation, chance),
        )
        self._seen = (0.0, 0.0)
        self._counted = [0.0, 0.0]
        self._burst_begins = self._wait(0.0)
        self._burst_ends = 0.0
        self._burst = 0.0

    def measure(self, truth: Truth) -> WheelReading:
        """Return the counters at the time of the truth."""
        settings = self._settings
        burst = self._burst_share(truth.time)
        burst += sum(slip.share for slip in settings.slips if slip.window.holds(truth.time))
        scales = (
            settings.scale * (1.0 + 0.5 * settings.imbalance),
            settings.scale * (1.0 - 0.5 * settings.imbalance),
        )
        travelled = (truth.left, truth.right)
        for side, (slip, scale) in enumerate(zip(self._slips, scales, strict=True)):
            rolled = travelled[side] - self._seen[side]
            self._counted[side] += scale * rolled * (1.0 + slip.at(truth.time) + burst)
        self._seen = travelled
        left, right = (math.floor(counted / settings.tick) * settings.tick for counted in self._counted)
        return WheelReading(truth.time, left, right)

    def _wait(self, time: float) -> float:
        if self._settings.burst_interval <= 0.0:
            return math.inf
        return time + self._settings.burst_interval * float(self._chance.exponential())

    def _burst_share(self, time: float) -> float:
        if time >= self._burst_begins:
            self._burst_ends = self._burst_begins + self._settings.burst_length * float(
                self._chance.exponential()
            )
            self._burst = self._settings.burst_slip * float(self._chance.uniform(0.5, 1.5))
            self._burst_begins = self._wait(self._burst_ends)
        return self._burst if time < self._burst_ends else 0.0
