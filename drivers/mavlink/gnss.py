"""Satellite receivers: GPS_RAW_INT, GPS2_RAW; and the local origin, GPS_GLOBAL_ORIGIN."""

from __future__ import annotations

import math
from typing import Any

from drivers.mavlink.moment import Moment, Timed
from drivers.sample import AnyReading, GeodeticPosition, Heading, Origin, Velocity

DEGREE_E7 = math.radians(1e-7)
CENTIDEGREE = math.radians(1e-2)
DEGREE_E5 = math.radians(1e-5)
MILLIMETRE = 1e-3
CENTIMETRE = 1e-2

UNKNOWN_8, UNKNOWN_16 = 0xFF, 0xFFFF
UNKNOWN_32 = 0xFFFFFFFF
FIX_2D, FIX_3D = 2, 3
NORTH = 36_000


def accuracy(millimetres: int) -> float | None:
    """Return a sigma in metres; 0 (an extension field that was not sent) and UINT32_MAX mean not known."""
    return None if millimetres in (0, UNKNOWN_32) else millimetres * MILLIMETRE


class Receiver:
    """GPS_RAW_INT 24 and GPS2_RAW 124 of one receiver.

    In an outage an autopilot goes on sending the last fix with its old stamp: a stamp that repeats is
    passed over. ``eph`` and ``epv`` are dilutions, not metres, and are not used; a sigma is given where ``h_acc``
    says one.
    """

    def __init__(self) -> None:
        self._last_stamp = 0

    def __call__(self, fields: Any, at: Moment) -> list[Timed]:
        """Return position, velocity and heading of a new fix of two dimensions or more."""
        if fields.fix_type < FIX_2D:
            at.pass_over("fix_type")
            return []
        if fields.time_usec and fields.time_usec == self._last_stamp:
            at.pass_over("time_usec")
            return []
        self._last_stamp = fields.time_usec
        time = at.microseconds(fields.time_usec)
        readings = (self._position(fields, at), self._velocity(fields, at), self._heading(fields, at))
        return [(time, reading) for reading in readings if reading is not None]

    @staticmethod
    def _position(fields: Any, at: Moment) -> AnyReading | None:
        if fields.lat == 0 and fields.lon == 0:
            at.refuse("lat")
            return None
        full = fields.fix_type >= FIX_3D
        satellites: int = fields.satellites_visible
        return GeodeticPosition(
            fields.lat * DEGREE_E7,
            fields.lon * DEGREE_E7,
            fields.alt * MILLIMETRE if full else None,
            accuracy(fields.h_acc),
            accuracy(fields.v_acc) if full else None,
            None if satellites == UNKNOWN_8 else satellites,
        )

    @staticmethod
    def _velocity(fields: Any, at: Moment) -> AnyReading | None:
        if UNKNOWN_16 in (fields.vel, fields.cog):
            return None
        if fields.cog > NORTH:
            at.refuse("cog")
            return None
        speed, course = fields.vel * CENTIMETRE, fields.cog * CENTIDEGREE
        return Velocity(speed * math.cos(course), speed * math.sin(course), sigma=accuracy(fields.vel_acc))

    @staticmethod
    def _heading(fields: Any, at: Moment) -> AnyReading | None:
        """Yaw of a receiver with two antennas: 0 is none, 36000 north, UINT16_MAX not known just now."""
        if fields.yaw in (0, UNKNOWN_16):
            return None
        if fields.yaw > NORTH:
            at.refuse("yaw")
            return None
        sigma = None if fields.hdg_acc in (0, UNKNOWN_32) else fields.hdg_acc * DEGREE_E5
        return Heading(math.remainder(fields.yaw * CENTIDEGREE, math.tau), sigma)


def global_origin(fields: Any, at: Moment) -> list[Timed]:
    """GPS_GLOBAL_ORIGIN 49: 0, 0 was not set. Its time is when it was heard: an origin does not age."""
    if fields.latitude == 0 and fields.longitude == 0:
        at.pass_over("latitude")
        return []
    origin = Origin(fields.latitude * DEGREE_E7, fields.longitude * DEGREE_E7, fields.altitude * MILLIMETRE)
    return [(at.received, origin)]
