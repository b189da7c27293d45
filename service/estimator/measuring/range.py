"""Range: the distance to a beacon that stands where the configuration, or the beacon itself, says."""

from __future__ import annotations

import math

from drivers.sample import Range as RangeReading
from filters.sensing import Range, RangeMeasurement
from filters.sensing.biased_range import BiasedRange, BiasedRangeMeasurement
from service.config import Beacon, Sensor
from service.estimator.measuring.kind import Bound, Kind, Place, Surroundings
from service.estimator.start import beacon_bias, biased_beacons
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


def _model(settings: Sensor, surroundings: Surroundings) -> Range | BiasedRange:
    sigma, scale = settings.sigma or DEFAULT_SIGMA, "range_scale" if "scale" in settings.estimate else None
    biased = biased_beacons(settings, surroundings.beacons)
    if not biased and not settings.nlos and surroundings.height is None:
        return Range(sigma, outliers=settings.outliers, span=SPAN, scale=scale)
    return BiasedRange(
        sigma,
        outliers=settings.outliers,
        span=SPAN,
        scale=scale,
        biases={beacon: beacon_bias(beacon) for beacon in biased},
        nlos=settings.nlos,
        nlos_length=settings.nlos_length,
        height=surroundings.height,
    )


def _measure(
    sensor: Bound, reading: RangeReading, place: Place
) -> RangeMeasurement | BiasedRangeMeasurement | str:
    where = beacon_position(reading, sensor.surroundings.beacons, place.frame)
    if where is None:
        return "no_beacon"
    north, east, down = where
    sigma = sensor.spread(reading.sigma, place)
    if isinstance(sensor.model, BiasedRange):
        return BiasedRangeMeasurement(reading.distance, north, east, down - place.down, sigma, reading.beacon)
    return RangeMeasurement(reading.distance, north, east, down - place.down, sigma)


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
