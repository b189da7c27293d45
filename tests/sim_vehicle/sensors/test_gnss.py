"""The satellite receiver: errors as claimed, a late stamp, frozen in an outage."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_vehicle.chance import stream
from sim_vehicle.faults import Window
from sim_vehicle.sensors import Cadence, Gnss, GnssSettings
from tests.sim_vehicle.sensors.truths import straight

CADENCE = Cadence(5.0)


def test_errors_are_as_large_as_claimed() -> None:
    """2,000 receivers: normalised errors have variance 1; bounds of five sigma, 5 sqrt(2/n)."""
    settings = GnssSettings(CADENCE, wander=0.3, noise=0.2, velocity_noise=0.1, dilution_spread=0.3)
    horizontal, vertical, velocity = [], [], []
    for seed in range(2000):
        reading = Gnss(settings, stream(seed, "g")).measure(straight(3.0))
        horizontal += [(reading.position[0] - 4.5) / reading.accuracy_horizontal]
        horizontal += [reading.position[1] / reading.accuracy_horizontal]
        vertical += [reading.position[2] / reading.accuracy_vertical]
        velocity += [(reading.velocity[0] - 1.5) / reading.accuracy_velocity]
    assert np.var(horizontal) == pytest.approx(1.0, abs=5.0 * math.sqrt(2.0 / 4000))
    assert np.var(vertical) == pytest.approx(1.0, abs=5.0 * math.sqrt(2.0 / 2000))
    assert np.var(velocity) == pytest.approx(1.0, abs=5.0 * math.sqrt(2.0 / 2000))


def test_the_position_is_older_than_its_stamp() -> None:
    settings = GnssSettings(CADENCE, delay=0.12, wander=0.0, noise=0.0)
    reading = Gnss(settings, stream(1, "g")).measure(straight(2.0))
    assert reading.time == pytest.approx(2.12)
    assert reading.position == pytest.approx((3.0, 0.0, 0.0))


def test_dilution_grows_the_claim_and_takes_satellites() -> None:
    readings = [
        Gnss(GnssSettings(CADENCE, dilution_spread=0.4), stream(seed, "g")).measure(straight(0.0))
        for seed in range(200)
    ]
    dilutions = np.array([reading.dilution for reading in readings])
    claims = np.array([reading.accuracy_horizontal for reading in readings])
    satellites = np.array([reading.satellites for reading in readings])
    assert claims / dilutions == pytest.approx(np.full(200, claims[0] / dilutions[0]))
    assert np.corrcoef(dilutions, satellites)[0, 1] < -0.7


def test_an_outage_freezes_the_last_fix() -> None:
    receiver = Gnss(GnssSettings(CADENCE, outages=(Window(1.0, 2.0),)), stream(1, "g"))
    before, during, after = (receiver.measure(straight(time)) for time in (0.8, 1.4, 2.2))
    assert (before.fix, during.fix, after.fix) == (True, False, True)
    assert (during.time, during.position) == (before.time, before.position)
    assert during.satellites == 0
    assert after.position != before.position


def test_without_any_fix_there_is_no_position() -> None:
    reading = Gnss(GnssSettings(CADENCE, outages=(Window(),)), stream(1, "g")).measure(straight(5.0))
    assert not reading.fix
    assert reading.position == (0.0, 0.0, 0.0)
