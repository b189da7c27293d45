"""Speed: of a wheel, a motor, a radar, or over ground by a receiver.

Where the vehicle's speed is a control (unicycle) a speed is compared with what the odometry says, and bears on its
scale; the speeds that make that control up themselves say nothing new. Where the velocity is a state (constant
velocity) it is compared with that.
"""

from __future__ import annotations

import math
from typing import Any, cast

from drivers.sample import SECOND, MotorSpeed, Odometer
from drivers.sample import Speed as SpeedReading
from filters.motion.constant_velocity import VELOCITY_NORTH
from filters.sensing.speed import GroundSpeed, GroundSpeedMeasurement, WheelSpeed, WheelSpeedMeasurement
from service.config import Sensor
from service.estimator.measuring.kind import Bound, Kind, Place, Surroundings
from service.estimator.speedometer import Speedometer
from service.estimator.start import slow_state
from service.estimator.track import SPEED_WINDOW
from service.estimator.wheels import CORRELATION, DEFAULT_SIGMA

SPAN = 100.0

NO_ODOMETRY = "no_odometry"


def _model(settings: Sensor, surroundings: Surroundings) -> WheelSpeed | GroundSpeed:
    kind = WheelSpeed if surroundings.rolls else GroundSpeed
    return kind(
        settings.sigma or DEFAULT_SIGMA,
        outliers=settings.outliers,
        span=SPAN,
        scale=slow_state(settings, "scale") if "scale" in settings.estimate else None,
        bias=slow_state(settings, "bias") if "bias" in settings.estimate else None,
    )


def _measure(
    sensor: Bound, reading: Any, place: Place
) -> WheelSpeedMeasurement | GroundSpeedMeasurement | str:
    said = cast(Speedometer, sensor.memory).read(place.time, reading)
    if isinstance(said, str):
        return said
    if isinstance(sensor.model, WheelSpeed):
        return _beside_the_odometry(sensor, said, place)
    loose = 0.0 if place.motion is None else place.motion.conditional_variances.get(VELOCITY_NORTH, 0.0)
    return GroundSpeedMeasurement(abs(said.speed), sensor.spread(said.sigma, place), loose)


def _beside_the_odometry(sensor: Bound, said: SpeedReading, place: Place) -> WheelSpeedMeasurement | str:
    """Return a speed beside the control's, whose own noise over the moment it is taken for comes on top."""
    controls = place.controls
    half = SPEED_WINDOW // 2
    if controls.distance(place.time - half, place.time + half).unknown > 0.0:
        return NO_ODOMETRY
    own = sensor.surroundings.speed_noise / math.sqrt(SPEED_WINDOW / SECOND)
    sigma = math.hypot(sensor.spread(said.sigma, place), own)
    right = 0.0 if sensor.settings.lever is None else sensor.settings.lever[1]
    rolled, yaw_rate = controls.speed(place.time), controls.yaw_rate(place.time)
    return WheelSpeedMeasurement(said.speed, rolled, yaw_rate, right, sigma)


def _label(settings: Sensor) -> str:
    index = None if settings.index is None else str(settings.index)
    return "".join(f"/{part}" for part in (settings.source, index) if part is not None)


SPEED = Kind(
    (SpeedReading, MotorSpeed, Odometer),
    _model,
    _measure,
    default_sigma=DEFAULT_SIGMA,
    spans=(SPAN,),
    correlation=CORRELATION,
    wants=lambda settings, reading: (
        not isinstance(reading, MotorSpeed) or settings.index in (None, reading.index)
    ),
    memory=lambda settings, surroundings: Speedometer(settings.index, surroundings.wheel_radius),
    label=_label,
    part=lambda settings: settings.index,
)
