"""A satellite receiver: position and velocity with errors, late, and honest about its accuracy.

The errors and the claimed accuracy grow together with a dilution that wanders too. Without satellites it goes
on talking, as receivers do: no fix, position and time of the last one. What others do to it from outside is in
:mod:`sim_vehicle.sensors.interference`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from sim_vehicle.faults import Window
from sim_vehicle.sensors.cadence import Cadence
from sim_vehicle.sensors.correlated import Wander
from sim_vehicle.sensors.interference import Effect, Interference
from sim_vehicle.world import Truth

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class GnssSettings:
    """Facts of the receiver; standard deviations at a dilution of 1.

    Attributes
    ----------
    cadence : Cadence
        When a fix is taken; its latency and jitter come after the stamp.
    delay : float
        Seconds by which the described position is older than the stamp.
    wander, wander_correlation : float
        Correlated error per horizontal axis (m), and how long it lasts (s).
    noise : float
        White error per horizontal axis, m. Vertical errors are 1.6 times the horizontal ones.
    velocity_noise : float
        Per axis, m/s.
    dilution_spread : float
        Standard deviation of the logarithm of the dilution.
    claim : float
        Claimed accuracy over the true one: below 1 it flatters itself.
    outages : tuple[Window, ...]
        When no satellite is seen.
    interference : tuple[Interference, ...]
        What is done to it from outside.
    """

    cadence: Cadence
    delay: float = 0.1
    wander: float = 0.3
    wander_correlation: float = 40.0
    noise: float = 0.15
    velocity_noise: float = 0.08
    dilution_spread: float = 0.15
    claim: float = 1.0
    outages: tuple[Window, ...] = ()
    interference: tuple[Interference, ...] = ()

    @property
    def sigma(self) -> float:
        """Standard deviation of a horizontal axis at a dilution of 1, metres."""
        return math.hypot(self.wander, self.noise)


@dataclass(frozen=True, slots=True)
class GnssReading:
    """What the receiver says.

    Attributes
    ----------
    time : float
        Its stamp, seconds since the drive began.
    fix : bool
        Whether it has one; without, the rest is that of the last fix.
    position, velocity : Vector
        Metres and m/s, north, east, down.
    accuracy_horizontal, accuracy_vertical, accuracy_velocity : float
        Claimed standard deviations.
    satellites : int
        In use.
    dilution : float
        Horizontal dilution of precision.
    """

    time: float
    fix: bool
    position: Vector
    velocity: Vector
    accuracy_horizontal: float
    accuracy_vertical: float
    accuracy_velocity: float
    satellites: int
    dilution: float


_VERTICAL = 1.6
_NEVER = GnssReading(0.0, False, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0, 99.99)


class Gnss:
    """The satellite receiver of a rover.

    The truth handed to :meth:`measure` is that of the fix; its stamp lies ``delay`` later.
    """

    def __init__(self, settings: GnssSettings, chance: np.random.Generator) -> None:
        self._settings = settings
        self._chance = chance
        self._wander = tuple(Wander(settings.wander, settings.wander_correlation, chance) for _ in range(3))
        self._dilution = Wander(settings.dilution_spread, 30.0, chance)
        self._last = _NEVER
        whose = chance.spawn(len(settings.interference)) if settings.interference else []
        self._disturbers = [
            source.engage(own) for source, own in zip(settings.interference, whose, strict=True)
        ]

    def measure(self, truth: Truth) -> GnssReading:
        """Return what the receiver says of the time of the truth."""
        settings = self._settings
        dilution = math.exp(self._dilution.at(truth.time))
        wander = [axis.at(truth.time) for axis in self._wander]
        white, velocity_error = self._chance.standard_normal((2, 3))
        effects = [disturber.at(truth.time) for disturber in self._disturbers]
        silenced = any(effect.silent for effect in effects)
        if silenced or any(window.holds(truth.time) for window in settings.outages):
            self._last = replace(self._last, fix=False, satellites=0, dilution=99.99)
            return self._last
        true_position = (truth.north, truth.east, truth.down)
        stretch = (dilution, dilution, _VERTICAL * dilution)
        north, east, down = (
            true_position[axis] + stretch[axis] * (wander[axis] + settings.noise * float(white[axis]))
            for axis in range(3)
        )
        vn, ve, vd = (
            truth.velocity[axis] + dilution * settings.velocity_noise * float(velocity_error[axis])
            for axis in range(3)
        )
        claimed = settings.claim * dilution
        reading = GnssReading(
            time=truth.time + settings.delay,
            fix=True,
            position=(north, east, down),
            velocity=(vn, ve, vd),
            accuracy_horizontal=claimed * settings.sigma,
            accuracy_vertical=_VERTICAL * claimed * settings.sigma,
            accuracy_velocity=claimed * settings.velocity_noise,
            satellites=max(5, min(20, round(14.0 / dilution))),
            dilution=0.8 * dilution,
        )
        self._last = _disturbed(reading, effects)
        return self._last


def _disturbed(reading: GnssReading, effects: list[Effect]) -> GnssReading:
    """Return what the receiver says when all effects are added to what it would have said."""
    for effect in effects:
        (north, east, down), (vn, ve, vd) = reading.position, reading.velocity
        claim = reading.accuracy_horizontal if effect.claim is None else effect.claim
        reading = replace(
            reading,
            position=(north + effect.offset[0], east + effect.offset[1], down),
            velocity=(vn + effect.velocity[0], ve + effect.velocity[1], vd),
            accuracy_horizontal=claim,
        )
    return reading
