"""A magnetometer: the Earth's field in the body's axes, bent by the rover's own iron, with noise."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sim_vehicle.sensors.cadence import Cadence
from sim_vehicle.sensors.correlated import Wander
from sim_vehicle.world import Truth

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class CompassSettings:
    """Facts of the magnetometer; fields in tesla.

    Attributes
    ----------
    cadence : Cadence
        When it is read.
    earth : Vector
        The Earth's field at the site: toward true north, east and down. East is not zero where there is
        declination.
    hard_iron : Vector
        What the rover's own iron adds, in the body's axes.
    noise : float
        Standard deviation per axis, white.
    disturbance, disturbance_correlation : float
        Standard deviation of the heading's wandering error (radians: cables, fences, parked cars), and how
        long it lasts (s).
    """

    cadence: Cadence
    earth: Vector = (20.2e-6, 0.0, 44.0e-6)
    hard_iron: Vector = (0.0, 0.0, 0.0)
    noise: float = 0.0
    disturbance: float = 0.0
    disturbance_correlation: float = 20.0

    @property
    def declination(self) -> float:
        """Angle from true to magnetic north, radians, positive to the east."""
        return math.atan2(self.earth[1], self.earth[0])


@dataclass(frozen=True, slots=True)
class CompassReading:
    """The magnetic field, tesla, forward, right, down, at ``time``."""

    time: float
    field: Vector

    def heading(self, declination: float) -> float:
        """Return the heading that the field shows for a level body, radians from true north, not wrapped."""
        return math.atan2(-self.field[1], self.field[0]) + declination


class Compass:
    """The magnetometer of a rover."""

    def __init__(self, settings: CompassSettings, chance: np.random.Generator) -> None:
        self._settings = settings
        self._chance = chance
        self._disturbance = Wander(settings.disturbance, settings.disturbance_correlation, chance)

    def measure(self, truth: Truth) -> CompassReading:
        """Return the field at the time of the truth."""
        settings = self._settings
        angle = truth.heading + self._disturbance.at(truth.time)
        north, east, down = settings.earth
        noise = settings.noise * self._chance.standard_normal(3)
        forward = north * math.cos(angle) + east * math.sin(angle)
        right = east * math.cos(angle) - north * math.sin(angle)
        iron = settings.hard_iron
        return CompassReading(
            truth.time,
            (
                forward + iron[0] + float(noise[0]),
                right + iron[1] + float(noise[1]),
                down + iron[2] + float(noise[2]),
            ),
        )
