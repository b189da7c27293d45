"""Ranges: RANGING_BEACON to beacons, DISTANCE_SENSOR to the ground or a wall."""

from __future__ import annotations

import math
from typing import Any

from drivers.mavlink.gnss import CENTIMETRE, DEGREE_E7, MILLIMETRE, UNKNOWN_32, accuracy
from drivers.mavlink.moment import Moment, Timed
from drivers.sample import Clearance, Range

UNKNOWN_POSITION = 2**31 - 1
ALTITUDE_ELLIPSOID, ALTITUDE_SEA = 0, 1
COVARIANCE_UNKNOWN = 255
SIGNAL_INVALID = 1


class Beacons:
    """RANGING_BEACON 513. ``geoid_height``: metres of the sea level above the ellipsoid, if known."""

    def __init__(self, geoid_height: float | None) -> None:
        self._geoid_height = geoid_height

    def __call__(self, fields: Any, at: Moment) -> list[Timed]:
        """Return the range; where the beacon says so, with its place."""
        if fields.range in (0, UNKNOWN_32):
            at.pass_over("range")
            return []
        latitude = longitude = altitude = None
        if fields.lat != UNKNOWN_POSITION and fields.lon != UNKNOWN_POSITION and (fields.lat or fields.lon):
            latitude, longitude = fields.lat * DEGREE_E7, fields.lon * DEGREE_E7
            altitude = self._altitude(fields, at)
        reading = Range(
            fields.beacon_id,
            fields.range * MILLIMETRE,
            accuracy(fields.range_accuracy),
            latitude,
            longitude,
            altitude,
        )
        return [(at.microseconds(fields.time_usec), reading)]

    def _altitude(self, fields: Any, at: Moment) -> float | None:
        """Return the altitude above mean sea level; one above the ellipsoid needs the geoid."""
        if not math.isfinite(fields.alt):
            return None
        if fields.alt_type == ALTITUDE_SEA:
            return float(fields.alt)
        if fields.alt_type == ALTITUDE_ELLIPSOID:
            return None if self._geoid_height is None else float(fields.alt) - self._geoid_height
        at.refuse("alt_type")
        return None


def distance_sensor(fields: Any, at: Moment) -> list[Timed]:
    """DISTANCE_SENSOR 132: beyond its limits a sensor repeats the limit, so a limit is no distance."""
    distance: int = fields.current_distance
    beyond = fields.max_distance > 0 and distance >= fields.max_distance
    if distance == 0 or distance <= fields.min_distance or beyond:
        at.pass_over("out_of_range")
        return []
    if fields.signal_quality == SIGNAL_INVALID:
        at.pass_over("signal_quality")
        return []
    variance: int = fields.covariance
    sigma = None if variance in (0, COVARIANCE_UNKNOWN) else math.sqrt(variance) * CENTIMETRE
    reading = Clearance(distance * CENTIMETRE, fields.orientation, sigma)
    return [(at.boot_ms(fields.time_boot_ms), reading)]
