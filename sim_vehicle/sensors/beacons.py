"""Ranges to radio beacons: white noise, and now and then a path round a corner, always longer (NLOS)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sim_vehicle.faults import Window
from sim_vehicle.sensors.cadence import Cadence
from sim_vehicle.world import Truth


@dataclass(frozen=True, slots=True)
class BeaconSite:
    """Where one beacon stands, metres north, east and down of the origin."""

    id: int
    north: float
    east: float
    down: float


@dataclass(frozen=True, slots=True)
class BeaconLoss:
    """One beacon, by its number, does not answer in this window."""

    beacon: int
    window: Window


@dataclass(frozen=True, slots=True)
class StrayRange:
    """One single range, the first one at or after ``time``, reads ``excess`` metres long."""

    time: float
    excess: float


@dataclass(frozen=True, slots=True)
class RangerSettings:
    """Facts of the rover's radio.

    Attributes
    ----------
    cadence : Cadence
        When ranges are taken, of all beacons together: they take turns.
    beacons : tuple[BeaconSite, ...]
        Who answers.
    sigma : float
        Standard deviation of the white noise, metres.
    outliers, outlier_mean : float
        Share of ranges that came by a longer path; mean of the excess, exponentially distributed, metres.
    scale : float
        Measured over true distance.
    reach : float
        Metres beyond which a beacon does not answer.
    losses : tuple[BeaconLoss, ...]
        Which beacons fall silent, and when.
    strays : tuple[StrayRange, ...]
        Single ranges that are far off.
    """

    cadence: Cadence
    beacons: tuple[BeaconSite, ...]
    sigma: float = 0.3
    outliers: float = 0.0
    outlier_mean: float = 4.0
    scale: float = 1.0
    reach: float = 500.0
    losses: tuple[BeaconLoss, ...] = ()
    strays: tuple[StrayRange, ...] = ()


@dataclass(frozen=True, slots=True)
class BeaconReading:
    """The distance to one beacon, metres, at ``time``; ``sequence`` counts the exchanges."""

    time: float
    beacon: BeaconSite
    distance: float
    sequence: int


class Ranger:
    """The rover's ranging radio, which asks its beacons in turn."""

    def __init__(self, settings: RangerSettings, chance: np.random.Generator) -> None:
        self._settings = settings
        self._chance = chance
        self._sequence = 0
        self._strays = sorted(settings.strays, key=lambda stray: stray.time)

    def measure(self, truth: Truth) -> BeaconReading | None:
        """Return the next beacon's range at the time of the truth; ``None``: it did not answer."""
        settings = self._settings
        beacon = settings.beacons[self._sequence % len(settings.beacons)]
        self._sequence += 1
        luck, excess = float(self._chance.random()), float(self._chance.exponential())
        noise = settings.sigma * float(self._chance.standard_normal())
        true = math.dist((truth.north, truth.east, truth.down), (beacon.north, beacon.east, beacon.down))
        if true > settings.reach or self._lost(beacon, truth.time):
            return None
        detour = settings.outlier_mean * excess if luck < settings.outliers else 0.0
        if self._strays and self._strays[0].time <= truth.time:
            detour += self._strays.pop(0).excess
        return BeaconReading(
            truth.time, beacon, max(0.0, settings.scale * true + detour + noise), self._sequence
        )

    def _lost(self, beacon: BeaconSite, time: float) -> bool:
        return any(loss.beacon == beacon.id and loss.window.holds(time) for loss in self._settings.losses)
