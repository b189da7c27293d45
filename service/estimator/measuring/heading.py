"""Heading: where the nose points, by a compass that says so or by a magnetometer."""

from __future__ import annotations

import math
from typing import Any

from drivers.sample import Heading as HeadingReading
from drivers.sample import Inertial
from filters.sensing import Heading, HeadingMeasurement
from service.config import Sensor
from service.estimator.measuring.kind import Bound, Kind, Place, Surroundings

DEFAULT_SIGMA = 0.1


def _model(settings: Sensor, _surroundings: Surroundings) -> Heading:
    return Heading(settings.sigma or DEFAULT_SIGMA, outliers=settings.outliers)


def _wants(_settings: Sensor, reading: HeadingReading | Inertial) -> bool:
    return not isinstance(reading, Inertial) or reading.magnetic_field is not None


def _measure(sensor: Bound, reading: Any, place: Place) -> HeadingMeasurement | str:
    if isinstance(reading, HeadingReading):
        return HeadingMeasurement(reading.heading, sensor.spread(reading.sigma, place))
    forward, right, _ = reading.magnetic_field
    if math.hypot(forward, right) < 1e-6:
        return "no_horizontal_field"
    magnetic = math.atan2(-right, forward)
    return HeadingMeasurement(
        magnetic + math.radians(sensor.settings.declination_deg), sensor.spread(None, place)
    )


HEADING = Kind(
    (HeadingReading, Inertial),
    _model,
    _measure,
    default_sigma=DEFAULT_SIGMA,
    spans=(2.0 * math.pi,),
    least_sigma=0.02,
    correlation=1.0,
    wants=_wants,
)
