"""Where the site is on the Earth: metres north, east, down to latitude, longitude, altitude."""

from __future__ import annotations

from dataclasses import dataclass
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
        latitude, longitude, altitude = cast(
            "tuple[Any, Any, Any]",
            pymap3d.ned2geodetic(north, east, down, self.latitude, self.longitude, self.altitude),
        )
        return float(latitude), float(longitude), float(altitude)
