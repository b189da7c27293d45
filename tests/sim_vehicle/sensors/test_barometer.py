"""The barometer against tabulated values of the standard atmosphere."""

from __future__ import annotations

import numpy as np
import pytest

from sim_vehicle.chance import stream
from sim_vehicle.sensors import Barometer, BarometerSettings, Cadence
from sim_vehicle.sensors.barometer import standard_altitude, standard_pressure
from tests.sim_vehicle.sensors.truths import straight


@pytest.mark.parametrize(("altitude", "pressure"), [(0.0, 101_325.0), (500.0, 95_461.0), (5000.0, 54_020.0)])
def test_pressures_are_those_of_the_table(altitude: float, pressure: float) -> None:
    assert standard_pressure(altitude) == pytest.approx(pressure, rel=1e-4)
    assert standard_altitude(standard_pressure(altitude)) == pytest.approx(altitude, abs=1e-6)


def test_noise_and_drift_have_the_spread_of_the_settings() -> None:
    """2,000 barometers: five sigma of a mean and of a standard deviation."""
    settings = BarometerSettings(Cadence(10.0), noise=3.0, drift=4.0)
    values = [
        Barometer(settings, 500.0, stream(seed, "b")).measure(straight(0.0)).pressure for seed in range(2000)
    ]
    assert np.mean(values) == pytest.approx(standard_pressure(500.0), abs=5.0 * 5.0 / np.sqrt(2000))
    assert np.std(values) == pytest.approx(5.0, rel=5.0 / np.sqrt(4000))
