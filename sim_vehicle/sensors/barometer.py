"""A barometer: the standard atmosphere's pressure (ICAO Doc 7488) with drift and noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sim_vehicle.sensors.cadence import Cadence
from sim_vehicle.sensors.correlated import Wander
from sim_vehicle.world import Truth

SEA_LEVEL_PRESSURE = 101_325.0
_SEA_LEVEL_TEMPERATURE = 288.15
_LAPSE = 0.0065
_EXPONENT = 5.25588


def standard_pressure(altitude: float) -> float:
    """Return the standard atmosphere's pressure in pascal at an altitude in metres, below 11 km."""
    return SEA_LEVEL_PRESSURE * (1.0 - _LAPSE * altitude / _SEA_LEVEL_TEMPERATURE) ** _EXPONENT


def standard_altitude(pressure: float) -> float:
    """Return the altitude in metres at which the standard atmosphere has this pressure in pascal."""
    return _SEA_LEVEL_TEMPERATURE / _LAPSE * (1.0 - (pressure / SEA_LEVEL_PRESSURE) ** (1.0 / _EXPONENT))


@dataclass(frozen=True, slots=True)
class BarometerSettings:
    """Facts of the barometer: white ``noise`` and wandering ``drift`` in pascal; kelvin."""

    cadence: Cadence
    noise: float = 0.0
    drift: float = 0.0
    drift_correlation: float = 120.0
    temperature: float = 293.15


@dataclass(frozen=True, slots=True)
class PressureReading:
    """Static pressure in pascal and temperature in kelvin at ``time``."""

    time: float
    pressure: float
    temperature: float


class Barometer:
    """The barometer of a rover that stands on a site of known altitude (metres above sea level)."""

    def __init__(self, settings: BarometerSettings, altitude: float, chance: np.random.Generator) -> None:
        self._settings = settings
        self._altitude = altitude
        self._chance = chance
        self._drift = Wander(settings.drift, settings.drift_correlation, chance)

    def measure(self, truth: Truth) -> PressureReading:
        """Return the pressure at the time of the truth."""
        true = standard_pressure(self._altitude - truth.down)
        noise = self._settings.noise * float(self._chance.standard_normal())
        return PressureReading(
            truth.time, true + self._drift.at(truth.time) + noise, self._settings.temperature
        )
