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
from service.estimator.measuring.sightings import Sightings

DEFAULT_SIGMA = 0.3
DEFAULT_SIGMA_BEARING = 0.05
NARROWEST, WIDEST = 1.0, 50.0
"""Metres; within these the map says how widely the distances scatter of what is no landmark."""

CIRCLE = 2.0 * math.pi

NOT_IN_THE_MAP = "no_landmark"
NO_NAME = "no_name"


def _table(surroundings: Surroundings) -> Any:
    return np.array(list(surroundings.landmarks.values()), np.float32).reshape(-1, 2)


def _span(surroundings: Surroundings) -> float:
    """Return how widely distances scatter that mean nothing: what moves among the landmarks is seen as far as they."""
    table = _table(surroundings)
    extent = math.hypot(*np.ptp(table, axis=0)) if len(table) else WIDEST
    return min(WIDEST, max(NARROWEST, extent))


def _where(sensor: Bound, landmark: int | None) -> tuple[float, float] | str | None:
    """Return where the landmark stands, ``None`` if it may be any, or why the reading cannot be used."""
    if sensor.settings.association == "unknown":
        return None
    if landmark is None:
        return NO_NAME
    return sensor.surroundings.landmarks.get(landmark, NOT_IN_THE_MAP)


def _share(
    sensor: Bound,
    landmark: int | None,
    place: Place,
    sight: tuple[float | None, float],
    sigmas: tuple[float, float],
) -> float:
    """Return what a sight is worth, of an independent one; of a landmark by its name only where names are believed."""
    sightings: Sightings = sensor.memory
    if sensor.settings.association == "known":
        return sightings.share(place.time, landmark)
    return sightings.share_unnamed(place.time, sight, sigmas, place.controls)


def _sightings(settings: Sensor, _surroundings: Surroundings) -> Sightings:
    return Sightings(settings)


def _bearing_model(settings: Sensor, surroundings: Surroundings) -> Bearing:
    return Bearing(
        settings.sigma or DEFAULT_SIGMA_BEARING, outliers=settings.outliers, landmarks=_table(surroundings)
    )


def _measure_bearing(sensor: Bound, reading: BearingReading, place: Place) -> BearingMeasurement | str:
    where = _where(sensor, reading.landmark)
    if isinstance(where, str):
        return where
    north, east = where or (None, None)
    sigma = sensor.spread(reading.sigma, place)
    share = _share(sensor, reading.landmark, place, (None, reading.bearing), (0.0, sigma))
    return BearingMeasurement(reading.bearing, north, east, sigma, share)


def _range_bearing_model(settings: Sensor, surroundings: Surroundings) -> RangeBearing:
    return RangeBearing(
        settings.sigma or DEFAULT_SIGMA,
        settings.sigma_bearing or DEFAULT_SIGMA_BEARING,
        outliers=settings.outliers,
        span=_span(surroundings),
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
    sigmas = (
        sensor.spread(reading.sigma_distance, place),
        max(bearing_sigmas, default=DEFAULT_SIGMA_BEARING),
    )
    share = _share(sensor, reading.landmark, place, (reading.distance, reading.bearing), sigmas)
    return RangeBearingMeasurement(reading.distance, reading.bearing, north, east, *sigmas, share)


BEARING = Kind(
    (BearingReading,),
    _bearing_model,
    _measure_bearing,
    default_sigma=DEFAULT_SIGMA_BEARING,
    spans=(CIRCLE,),
    absolute=True,
    memory=_sightings,
    tempers=True,
)

RANGE_BEARING = Kind(
    (RangeBearingReading,),
    _range_bearing_model,
    _measure_range_bearing,
    default_sigma=DEFAULT_SIGMA,
    spans=lambda surroundings: (_span(surroundings), CIRCLE),
    absolute=True,
    shifted=True,
    memory=_sightings,
    tempers=True,
)
