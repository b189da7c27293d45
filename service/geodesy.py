"""Between the globe and the vehicle's local frame: WGS 84 to north, east, down of the origin and back."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import pymap3d

ANCHOR_REACH = 100.0
"""Metres about an exactly converted point within which the way back is linear: the error is below 2 mm up to 60° of
latitude, and the exact conversion, 200 µs, is not paid on every tick."""


class Geodetic(NamedTuple):
    """A point by latitude and longitude (radians, WGS 84) and altitude (metres; the origin's own datum)."""

    latitude: float
    longitude: float
    altitude: float


def _floats(triple: Any) -> tuple[float, float, float]:
    """Return what pymap3d gives (it ships no types) as plain numbers."""
    first, second, third = triple
    return float(first), float(second), float(third)


def _turned(longitude: float) -> float:
    """Return the same meridian in -pi to pi: the 180th is no edge of the world."""
    return longitude if -math.pi <= longitude <= math.pi else math.remainder(longitude, math.tau)


class _Anchor(NamedTuple):
    """An exactly converted point and the derivative of the conversion there, column by column."""

    ned: tuple[float, float, float]
    point: Geodetic
    per_north: Geodetic
    per_east: Geodetic
    per_down: Geodetic


class LocalFrame:
    """The tangent plane at an origin; altitude differences are taken as they are, whatever their datum.

    Parameters
    ----------
    origin : Geodetic
        Where north = east = down = 0.
    """

    def __init__(self, origin: Geodetic) -> None:
        self.origin = origin
        self._anchor = self._anchor_at(0.0, 0.0, 0.0)

    def ned_from_geodetic(
        self, latitude: float, longitude: float, altitude: float
    ) -> tuple[float, float, float]:
        """Return (north, east, down), metres, of a point given in radians and metres."""
        return _floats(pymap3d.geodetic2ned(latitude, longitude, altitude, *self.origin, deg=False))

    def geodetic_from_ned(self, north: float, east: float, down: float) -> Geodetic:
        """Return the point (radians, metres) that lies ``north``, ``east``, ``down`` metres from the origin."""
        anchor = self._anchor
        x, y, z = north - anchor.ned[0], east - anchor.ned[1], down - anchor.ned[2]
        if max(abs(x), abs(y), abs(z)) > ANCHOR_REACH:
            anchor = self._anchor = self._anchor_at(north, east, down)
            x = y = z = 0.0
        point, a, b, c = anchor.point, anchor.per_north, anchor.per_east, anchor.per_down
        return Geodetic(
            point.latitude + x * a.latitude + y * b.latitude + z * c.latitude,
            _turned(point.longitude + x * a.longitude + y * b.longitude + z * c.longitude),
            point.altitude + x * a.altitude + y * b.altitude + z * c.altitude,
        )

    def _exact(self, north: float, east: float, down: float) -> Geodetic:
        return Geodetic(*_floats(pymap3d.ned2geodetic(north, east, down, *self.origin, deg=False)))

    def _anchor_at(self, north: float, east: float, down: float) -> _Anchor:
        half = ANCHOR_REACH / 2

        def slope(x: float, y: float, z: float) -> Geodetic:
            ahead = self._exact(north + x * half, east + y * half, down + z * half)
            behind = self._exact(north - x * half, east - y * half, down - z * half)
            latitude, longitude, altitude = (p - q for p, q in zip(ahead, behind, strict=True))
            return Geodetic(latitude / (2 * half), _turned(longitude) / (2 * half), altitude / (2 * half))

        return _Anchor(
            (north, east, down),
            self._exact(north, east, down),
            slope(1, 0, 0),
            slope(0, 1, 0),
            slope(0, 0, 1),
        )

    @classmethod
    def from_degrees(cls, latitude: float, longitude: float, altitude: float) -> LocalFrame:
        """Return the frame at an origin given in degrees and metres, as a configuration writes it."""
        return cls(Geodetic(math.radians(latitude), math.radians(longitude), altitude))
