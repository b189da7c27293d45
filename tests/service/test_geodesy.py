"""The way to the local frame and back closes, and agrees with the ellipsoid's own radii."""

from __future__ import annotations

import math

import numpy as np
import pytest

from service.geodesy import ANCHOR_REACH, LocalFrame

SEMI_MAJOR = 6378137.0
FLATTENING = 1 / 298.257223563


@pytest.mark.parametrize("latitude", [0.0, 40.4433, -35.36, 60.0, -75.0])
def test_there_and_back_within_five_millimetres(latitude: float) -> None:
    frame = LocalFrame.from_degrees(latitude, 149.165, 300.0)
    random = np.random.default_rng(7)
    for _ in range(40):
        centre = random.uniform((-5000, -5000, -50), (5000, 5000, 50))
        frame.geodetic_from_ned(*centre)
        for offset in random.uniform(-0.9 * ANCHOR_REACH, 0.9 * ANCHOR_REACH, (5, 3)) * (1, 1, 0.1):
            point = centre + offset
            back = frame.ned_from_geodetic(*frame.geodetic_from_ned(*point))
            assert np.allclose(back, point, atol=5e-3)


def test_small_steps_agree_with_the_radii_of_curvature() -> None:
    """A minute of arc north is the meridian radius times that angle; east, the parallel's."""
    latitude = math.radians(-35.0)
    frame = LocalFrame.from_degrees(-35.0, 149.0, 0.0)
    square = FLATTENING * (2 - FLATTENING)
    w = 1 - square * math.sin(latitude) ** 2
    meridian = SEMI_MAJOR * (1 - square) / w**1.5
    parallel = SEMI_MAJOR / math.sqrt(w) * math.cos(latitude)
    step = 1e-6
    north, _, _ = frame.ned_from_geodetic(latitude + step, math.radians(149.0), 0.0)
    _, east, _ = frame.ned_from_geodetic(latitude, math.radians(149.0) + step, 0.0)
    assert north == pytest.approx(meridian * step, rel=1e-6)
    assert east == pytest.approx(parallel * step, rel=1e-6)


def test_the_meridian_of_180_degrees_is_crossed_without_a_step() -> None:
    """On Fiji: the way back closes on both sides of it, and longitudes stay within -180 to 180 degrees."""
    frame = LocalFrame.from_degrees(-17.0, 180.0, 0.0)
    for east in (-250.0, -60.0, -1.0, 1.0, 60.0, 250.0):
        point = frame.geodetic_from_ned(10.0, east, 0.0)
        assert -math.pi <= point.longitude <= math.pi
        assert math.copysign(1.0, point.longitude) == -math.copysign(1.0, east)
        assert np.allclose(frame.ned_from_geodetic(*point), (10.0, east, 0.0), atol=5e-3)


def test_down_is_down() -> None:
    frame = LocalFrame.from_degrees(10.0, 20.0, 100.0)
    assert frame.ned_from_geodetic(math.radians(10.0), math.radians(20.0), 130.0)[2] == pytest.approx(-30.0)
    assert frame.geodetic_from_ned(0.0, 0.0, -30.0).altitude == pytest.approx(130.0)
