"""Velocity over ground: with the speed that the odometry has, it says which way the vehicle points.

Where the velocity is a state (constant velocity) it is compared with that.
"""

from __future__ import annotations

from drivers.sample import Velocity as VelocityReading
from filters.motion.constant_velocity import VELOCITY_NORTH
from filters.sensing import Velocity, VelocityMeasurement
from filters.sensing.free_velocity import FreeVelocity, FreeVelocityMeasurement
from service.config import Sensor
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
        loose = 0.0 if place.motion is None else place.motion.conditional_variances.get(VELOCITY_NORTH, 0.0)
        return FreeVelocityMeasurement(
            reading.north, reading.east, sensor.spread(reading.sigma, place), loose
        )
    speed = place.controls.speed(place.time)
    if abs(speed) < SLOWEST_COURSE:
        return "standing"
    sigma = sensor.spread(reading.sigma, place)
    return VelocityMeasurement(reading.north, reading.east, speed, sigma, place.controls.yaw_rate(place.time))


VELOCITY = Kind(
    (VelocityReading,),
    _model,
    _measure,
    default_sigma=DEFAULT_SIGMA,
    spans=(SPAN, SPAN),
    least_sigma=0.1,  # a receiver's velocity is filtered, and lags in turns
    correlation=1.0,
)
