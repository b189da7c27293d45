"""Landmarks seen from the nose: their bearing, or distance and bearing, by name or as any of the map."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from drivers.sample import Bearing as BearingReading
from drivers.sample import RangeBearing as RangeBearingReading
from filters.sensing import Bearing, BearingMeasurement, RangeBearing, RangeBearingMeasurement
from service.config import Sensor
from service.estimator.measuring.kind import Bound, Kind, Place, Surroundings

DEFAULT_SIGMA = 0.3
DEFAULT_SIGMA_BEARING = 0.05
SPAN = 50.0
CIRCLE = 2.0 * math.pi

NOT_IN_THE_MAP = "no_landmark"
NO_NAME = "no_name"


def _table(surroundings: Surroundings) -> Any:
    return np.array(list(surroundings.landmarks.values()), np.float32).reshape(-1, 2)


def _where(sensor: Bound, landmark: int | None) -> tuple[float, float] | str | None:
    """Return where the landmark stands, ``None`` if it may be any, or why the reading cannot be used."""
    if sensor.settings.association == "unknown":
        return None
    if landmark is None:
        return NO_NAME
    return sensor.surroundings.landmarks.get(landmark, NOT_IN_THE_MAP)


def _bearing_model(settings: Sensor, surroundings: Surroundings) -> Bearing:
    return Bearing(
        settings.sigma or DEFAULT_SIGMA_BEARING, outliers=settings.outliers, landmarks=_table(surroundings)
    )


def _measure_bearing(sensor: Bound, reading: BearingReading, place: Place) -> BearingMeasurement | str:
    where = _where(sensor, reading.landmark)
    if isinstance(where, str):
        return where
    north, east = where or (None, None)
    return BearingMeasurement(reading.bearing, north, east, sensor.spread(reading.sigma, place))


def _range_bearing_model(settings: Sensor, surroundings: Surroundings) -> RangeBearing:
    return RangeBearing(
        settings.sigma or DEFAULT_SIGMA,
        settings.sigma_bearing or DEFAULT_SIGMA_BEARING,
        outliers=settings.outliers,
        span=SPAN,
        landmarks=_table(surroundings),
    )


def _measure_range_bearing(
    sensor: Bound, reading: RangeBearingReading, place: Place
) -> RangeBearingMeasurement | str:
    where = _where(sensor, reading.landmark)
    if isinstance(where, str):
        return where
    north, east = where or (None, None)
    bearing_sigmas = (
        sigma for sigma in (sensor.settings.sigma_bearing, reading.sigma_bearing) if sigma is not None
    )
    return RangeBearingMeasurement(
        reading.distance,
        reading.bearing,
        north,
        east,
        sensor.spread(reading.sigma_distance, place),
        max(bearing_sigmas, default=DEFAULT_SIGMA_BEARING),
    )


BEARING = Kind(
    (BearingReading,),
    _bearing_model,
    _measure_bearing,
    default_sigma=DEFAULT_SIGMA_BEARING,
    spans=(CIRCLE,),
    absolute=True,
)

RANGE_BEARING = Kind(
    (RangeBearingReading,),
    _range_bearing_model,
    _measure_range_bearing,
    default_sigma=DEFAULT_SIGMA,
    spans=(SPAN, CIRCLE),
    absolute=True,
    shifted=True,
)
