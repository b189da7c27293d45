"""Position: a fix of a receiver, or of whatever else says where the vehicle is, in metres from the origin."""

from __future__ import annotations

from drivers.sample import GeodeticPosition, LocalPosition
from filters.sensing import Position, PositionMeasurement
from service.config import Sensor
from service.estimator.measuring.kind import Bound, Kind, Place, Surroundings, delay_state
from service.geodesy import LocalFrame

DEFAULT_SIGMA = 3.0
SPAN = 1000.0


def position_of(
    reading: GeodeticPosition | LocalPosition, frame: LocalFrame | None
) -> tuple[float, float, float | None] | None:
    """Return north, east and (where it is said) down of a position reading; ``None`` without an origin."""
    if isinstance(reading, LocalPosition):
        return reading.north, reading.east, reading.down
    if frame is None:
        return None
    altitude = frame.origin.altitude if reading.altitude is None else reading.altitude
    north, east, _ = frame.ned_from_geodetic(reading.latitude, reading.longitude, altitude)
    return north, east, None if reading.altitude is None else frame.origin.altitude - reading.altitude


def _model(settings: Sensor, _surroundings: Surroundings) -> Position:
    return Position(
        settings.sigma or DEFAULT_SIGMA, outliers=settings.outliers, span=SPAN, delay=delay_state(settings)
    )


def _measure(
    sensor: Bound, reading: GeodeticPosition | LocalPosition, place: Place
) -> PositionMeasurement | str:
    fix = position_of(reading, place.frame)
    if fix is None:
        return "no_origin"
    sigma = sensor.spread(reading.sigma_horizontal, place)
    speed, yaw_rate = place.controls.speed(place.time), place.controls.yaw_rate(place.time)
    return PositionMeasurement(fix[0], fix[1], sigma, sigma, speed, yaw_rate)


POSITION = Kind(
    (GeodeticPosition, LocalPosition),
    _model,
    _measure,
    default_sigma=DEFAULT_SIGMA,
    spans=(SPAN, SPAN),
    correlation=1.0,
    absolute=True,
    shifted=True,
)
