"""Velocity over ground: with the speed that the odometry has, it says which way the vehicle points.

Where the velocity is a state (constant velocity) it is compared with that; of one whose course is held
(:mod:`service.estimator.measuring.held_course`) only the speed is taken, in any direction.
"""

from __future__ import annotations

import math
from typing import cast

from drivers.sample import Velocity as VelocityReading
from filters.motion.constant_velocity import VELOCITY_NORTH
from filters.sensing import Velocity, VelocityMeasurement
from filters.sensing.free_velocity import FreeVelocity, FreeVelocityMeasurement
from service.config import Sensor
from service.estimator.measuring.held_course import HeldCourse
from service.estimator.measuring.kind import Bound, Kind, Place, Surroundings, delay_state

DEFAULT_SIGMA = 0.3
SPAN = 100.0

SLOWEST_COURSE = 0.3
"""m/s; below this the direction of a measured velocity is noise."""


def _model(settings: Sensor, surroundings: Surroundings) -> Velocity | FreeVelocity:
    sigma = settings.sigma or DEFAULT_SIGMA
    if not surroundings.rolls:
        return FreeVelocity(sigma, outliers=settings.outliers, span=SPAN)
    return Velocity(
        sigma,
        outliers=settings.outliers,
        span=SPAN,
        scale="odometry_scale",
        delay=delay_state(settings),
    )


def _measure(
    sensor: Bound, reading: VelocityReading, place: Place
) -> VelocityMeasurement | FreeVelocityMeasurement | str:
    if isinstance(sensor.model, FreeVelocity):
        return _free(sensor, reading, place)
    speed = place.controls.speed(place.time)
    if abs(speed) < SLOWEST_COURSE:
        return "standing"
    sigma = sensor.spread(reading.sigma, place)
    return VelocityMeasurement(reading.north, reading.east, speed, sigma, place.controls.yaw_rate(place.time))


def _free(sensor: Bound, reading: VelocityReading, place: Place) -> FreeVelocityMeasurement:
    """Return a velocity to compare with a state; a held course is any: zero on average, by its speed on both axes."""
    loose = 0.0 if place.motion is None else place.motion.conditional_variances.get(VELOCITY_NORTH, 0.0)
    sigma = sensor.spread(reading.sigma, place)
    if not cast(HeldCourse, sensor.memory).holds(reading.north, reading.east):
        return FreeVelocityMeasurement(reading.north, reading.east, sigma, loose)
    speed = math.hypot(reading.north, reading.east)
    return FreeVelocityMeasurement(0.0, 0.0, math.hypot(sigma, speed / math.sqrt(2.0)), loose)


VELOCITY = Kind(
    (VelocityReading,),
    _model,
    _measure,
    default_sigma=DEFAULT_SIGMA,
    spans=(SPAN, SPAN),
    least_sigma=0.1,  # a receiver's velocity is filtered, and lags in turns
    correlation=1.0,
    memory=lambda settings, surroundings: HeldCourse(),
)
