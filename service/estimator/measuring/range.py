"""Range: the distance to a beacon that stands where the configuration, or the beacon itself, says."""

from __future__ import annotations

import math

from drivers.sample import Range as RangeReading
from filters.sensing import Range, RangeMeasurement
from service.config import Beacon, Sensor
from service.estimator.measuring.kind import Bound, Kind, Place, Surroundings
from service.geodesy import LocalFrame

DEFAULT_SIGMA = 0.5
SPAN = 200.0


def beacon_position(
    reading: RangeReading, beacons: dict[int, Beacon], frame: LocalFrame | None
) -> tuple[float, float, float] | None:
    """Return where the beacon of ``reading`` stands (north, east, down): as configured, else as it says itself."""
    beacon = beacons.get(reading.beacon)
    if beacon is not None and beacon.position is not None:
        return beacon.position
    if frame is None:
        return None
    if beacon is not None and beacon.latitude is not None and beacon.longitude is not None:
        altitude = frame.origin.altitude if beacon.altitude is None else beacon.altitude
        return frame.ned_from_geodetic(
            math.radians(beacon.latitude), math.radians(beacon.longitude), altitude
        )
    if reading.latitude is not None and reading.longitude is not None:
        altitude = frame.origin.altitude if reading.altitude is None else reading.altitude
        return frame.ned_from_geodetic(reading.latitude, reading.longitude, altitude)
    return None


def _model(settings: Sensor, _surroundings: Surroundings) -> Range:
    scale = "range_scale" if "scale" in settings.estimate else None
    bias = "range_bias" if "bias" in settings.estimate else None
    return Range(
        settings.sigma or DEFAULT_SIGMA, outliers=settings.outliers, span=SPAN, scale=scale, bias=bias
    )


def _measure(sensor: Bound, reading: RangeReading, place: Place) -> RangeMeasurement | str:
    where = beacon_position(reading, sensor.surroundings.beacons, place.frame)
    if where is None:
        return "no_beacon"
    north, east, down = where
    return RangeMeasurement(
        reading.distance, north, east, down - place.down, sensor.spread(reading.sigma, place)
    )


RANGE = Kind(
    (RangeReading,),
    _model,
    _measure,
    default_sigma=DEFAULT_SIGMA,
    spans=(SPAN,),
    absolute=True,
    shifted=True,
    wants=lambda settings, reading: settings.beacons is None or reading.beacon in settings.beacons,
    suffix=lambda reading: f"/{reading.beacon}",
)
