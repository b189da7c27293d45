"""The magnetometer: headings all round, declination, disturbance."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_vehicle.chance import stream
from sim_vehicle.sensors import Cadence, Compass, CompassSettings
from tests.sim_vehicle.sensors.truths import straight

CADENCE = Cadence(25.0)


@pytest.mark.parametrize("heading", np.linspace(-3.1, 3.1, 9))
def test_the_field_shows_the_heading(heading: float) -> None:
    settings = CompassSettings(CADENCE, earth=(20e-6, 3e-6, 44e-6))
    reading = Compass(settings, stream(1, "c")).measure(straight(0.0, heading=heading))
    assert math.remainder(reading.heading(settings.declination) - heading, math.tau) == pytest.approx(
        0.0, abs=1e-12
    )
    assert math.hypot(*reading.field) == pytest.approx(math.hypot(20e-6, 3e-6, 44e-6))


def test_facing_magnetic_east_the_horizontal_field_is_on_the_left() -> None:
    settings = CompassSettings(CADENCE, earth=(20e-6, 0.0, 44e-6))
    field = Compass(settings, stream(1, "c")).measure(straight(0.0, heading=math.pi / 2)).field
    assert field == pytest.approx((0.0, -20e-6, 44e-6), abs=1e-15)


def test_noise_and_disturbance_have_the_spread_of_the_settings() -> None:
    """2,000 compasses, one reading each: five sigma of a standard deviation."""
    settings = CompassSettings(CADENCE, earth=(20e-6, 0.0, 44e-6), noise=0.2e-6, disturbance=0.03)
    headings = [
        Compass(settings, stream(seed, "c")).measure(straight(0.0)).heading(0.0) for seed in range(2000)
    ]
    expected = math.hypot(0.03, 0.2 / 20.0)
    assert np.std(headings) == pytest.approx(expected, rel=5.0 / math.sqrt(4000))
    assert abs(np.mean(headings)) < 5.0 * expected / math.sqrt(2000)


def test_the_rovers_iron_is_added_in_its_own_axes() -> None:
    settings = CompassSettings(CADENCE, earth=(20e-6, 0.0, 44e-6), hard_iron=(1e-6, 2e-6, 3e-6))
    field = Compass(settings, stream(1, "c")).measure(straight(0.0)).field
    assert field == pytest.approx((21e-6, 2e-6, 47e-6))
