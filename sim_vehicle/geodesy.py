"""Where the site is on the Earth: metres north, east, down to latitude, longitude, altitude."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, cast

import pymap3d


@dataclass(frozen=True, slots=True)
class Origin:
    """The point from which positions count; latitude and longitude in WGS 84 degrees, altitude in metres.

    The site lies where the geoid and the ellipsoid agree: altitude above sea level and height above the
    ellipsoid are one number.
    """

    latitude: float
    longitude: float
    altitude: float

    def geodetic(self, north: float, east: float, down: float) -> tuple[float, float, float]:
        """Return latitude and longitude in degrees and altitude in metres of a local point in metres."""
        return _geodetic(self, north, east, down)


# Beacons stand still and say where with every range: a few places are asked for again and again.
@lru_cache(maxsize=64)
def _geodetic(origin: Origin, north: float, east: float, down: float) -> tuple[float, float, float]:
    latitude, longitude, altitude = cast(
        "tuple[Any, Any, Any]",
        pymap3d.ned2geodetic(north, east, down, origin.latitude, origin.longitude, origin.altitude),
    )
    return float(latitude), float(longitude), float(altitude)
