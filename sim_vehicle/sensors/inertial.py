"""An inertial unit: three gyros and three accelerometers, with bias, its walk, and white noise.

The body stands level, so the yaw gyro sees the turn, the forward accelerometer the change of speed, the right
one the turn's v·ω, and the down one gravity (specific force: minus g when standing).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sim_vehicle.sensors.cadence import Cadence
from sim_vehicle.world import GRAVITY, Truth

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class InertialSettings:
    """Facts of the unit.

    Attributes
    ----------
    cadence : Cadence
        When it is read.
    gyro_bias : Vector
        At the start, rad/s, about forward, right and down.
    gyro_bias_walk : float
        Growth of the bias's spread, rad/s per root second.
    gyro_noise, accelerometer_noise : float
        White noise: rad/s and m/s² per root hertz.
    accelerometer_bias : Vector
        m/s².
    """

    cadence: Cadence
    gyro_bias: Vector = (0.0, 0.0, 0.0)
    gyro_bias_walk: float = 0.0
    gyro_noise: float = 0.0
    accelerometer_bias: Vector = (0.0, 0.0, 0.0)
    accelerometer_noise: float = 0.0


@dataclass(frozen=True, slots=True)
class InertialReading:
    """Angular velocity (rad/s) and specific force (m/s²), forward, right, down, at ``time``."""

    time: float
    angular_velocity: Vector
    specific_force: Vector


class Inertial:
    """The inertial unit of a rover."""

    def __init__(self, settings: InertialSettings, chance: np.random.Generator) -> None:
        self._settings = settings
        self._chance = chance
        self._bias = np.array(settings.gyro_bias)
        self._time = 0.0

    def measure(self, truth: Truth) -> InertialReading:
        """Return the unit's reading at the time of the truth."""
        settings = self._settings
        walk, gyro, accelerometer = self._chance.standard_normal((3, 3))
        elapsed, self._time = truth.time - self._time, truth.time
        self._bias = self._bias + settings.gyro_bias_walk * math.sqrt(max(elapsed, 0.0)) * walk
        bandwidth = math.sqrt(settings.cadence.rate)
        rates = np.array([0.0, 0.0, truth.yaw_rate]) + self._bias + settings.gyro_noise * bandwidth * gyro
        forces = (
            np.array([truth.acceleration, truth.speed * truth.yaw_rate, -GRAVITY])
            + np.array(settings.accelerometer_bias)
            + settings.accelerometer_noise * bandwidth * accelerometer
        )
        return InertialReading(
            truth.time,
            (float(rates[0]), float(rates[1]), float(rates[2])),
            (float(forces[0]), float(forces[1]), float(forces[2])),
        )
