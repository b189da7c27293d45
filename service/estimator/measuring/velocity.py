"""Velocity over ground: with the speed that the odometry has, it says which way the vehicle points."""

from __future__ import annotations

from drivers.sample import Velocity as VelocityReading
from filters.sensing import Velocity, VelocityMeasurement
from service.config import Sensor
from service.estimator.measuring.kind import Bound, Kind, Place, Surroundings, delay_state

DEFAULT_SIGMA = 0.3
SPAN = 100.0

SLOWEST_COURSE = 0.3
"""m/s; below this the direction of a measured velocity is noise."""


def _model(settings: Sensor, _surroundings: Surroundings) -> Velocity:
    return Velocity(
        settings.sigma or DEFAULT_SIGMA,
        outliers=settings.outliers,
        span=SPAN,
        scale="odometry_scale",
        delay=delay_state(settings),
    )


def _measure(sensor: Bound, reading: VelocityReading, place: Place) -> VelocityMeasurement | str:
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
