"""Local metres to latitude and longitude, against the radii of curvature of WGS 84 (closed form)."""

from __future__ import annotations

import math

import pytest

from sim_vehicle.geodesy import Origin

SEMI_MAJOR, FLATTENING = 6_378_137.0, 1.0 / 298.257223563


def test_small_offsets_follow_the_radii_of_curvature() -> None:
    origin = Origin(51.0, 4.0, 12.0)
    squared = FLATTENING * (2.0 - FLATTENING)
    shrink = 1.0 - squared * math.sin(math.radians(51.0)) ** 2
    prime_vertical = SEMI_MAJOR / math.sqrt(shrink)
    meridian = SEMI_MAJOR * (1.0 - squared) / shrink**1.5
    latitude, longitude, altitude = origin.geodetic(100.0, -50.0, 3.0)
    assert math.radians(latitude - 51.0) * (meridian + 12.0) == pytest.approx(100.0, abs=2e-3)
    east = math.radians(longitude - 4.0) * (prime_vertical + 12.0) * math.cos(math.radians(51.0))
    assert east == pytest.approx(-50.0, abs=2e-3)
    # The tangent plane leaves the ellipsoid by d² / 2R.
    assert altitude == pytest.approx(9.0 + (100.0**2 + 50.0**2) / (2.0 * SEMI_MAJOR), abs=1e-4)


def test_the_origin_is_itself() -> None:
    assert Origin(-35.0, 149.0, 584.0).geodetic(0.0, 0.0, 0.0) == pytest.approx((-35.0, 149.0, 584.0))
