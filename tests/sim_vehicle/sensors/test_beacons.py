"""Ranges: turns, noise, long paths, reach."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_vehicle.chance import stream
from sim_vehicle.faults import Window
from sim_vehicle.sensors import BeaconLoss, BeaconSite, Cadence, Ranger, RangerSettings, StrayRange
from tests.sim_vehicle.sensors.truths import straight

SITES = (BeaconSite(3, 30.0, 40.0, 0.0), BeaconSite(9, 0.0, 0.0, -12.0))
CADENCE = Cadence(20.0)


def test_beacons_answer_in_turn_with_the_distance_in_three_dimensions() -> None:
    ranger = Ranger(RangerSettings(CADENCE, SITES, sigma=0.0), stream(1, "r"))
    readings = [ranger.measure(straight(0.0)) for _ in range(4)]
    assert [reading.beacon.id for reading in readings if reading] == [3, 9, 3, 9]
    assert [reading.distance for reading in readings if reading] == pytest.approx([50.0, 12.0, 50.0, 12.0])
    assert [reading.sequence for reading in readings if reading] == [1, 2, 3, 4]


def test_noise_and_outliers_have_the_statistics_of_the_settings() -> None:
    """20,000 ranges: shares and spread within five sigma; a detour exceeds 1.5 m with exp(-1.5 / 4)."""
    settings = RangerSettings(CADENCE, SITES[:1], sigma=0.3, outliers=0.1, outlier_mean=4.0)
    ranger = Ranger(settings, stream(2, "r"))
    errors = np.array(
        [reading.distance - 50.0 for _ in range(20_000) if (reading := ranger.measure(straight(0.0)))]
    )
    far = 0.1 * math.exp(-1.5 / 4.0)
    assert (errors > 1.5).mean() == pytest.approx(far, abs=5.0 * math.sqrt(far / 20_000) + 0.004)
    clean = Ranger(RangerSettings(CADENCE, SITES[:1], sigma=0.3), stream(2, "r"))
    white = np.array(
        [reading.distance - 50.0 for _ in range(20_000) if (reading := clean.measure(straight(0.0)))]
    )
    assert white.std() == pytest.approx(0.3, rel=5.0 / math.sqrt(40_000))
    assert abs(white.mean()) < 5.0 * 0.3 / math.sqrt(20_000)
    # The same luck with and without long paths: only those differ, and they are longer.
    assert ((errors - white) >= -1e-12).all()
    assert (errors != white).mean() == pytest.approx(0.1, abs=5.0 * math.sqrt(0.09 / 20_000))


def test_a_beacon_out_of_reach_does_not_answer_and_no_range_is_negative() -> None:
    ranger = Ranger(RangerSettings(CADENCE, SITES, sigma=0.0, reach=20.0), stream(1, "r"))
    assert ranger.measure(straight(0.0)) is None
    assert ranger.measure(straight(0.0)) is not None
    here = Ranger(RangerSettings(CADENCE, (BeaconSite(0, 0.0, 0.0, 0.0),), sigma=1.0), stream(1, "r"))
    assert min(reading.distance for _ in range(100) if (reading := here.measure(straight(0.0)))) == 0.0


def test_the_scale_stretches_the_distance() -> None:
    ranger = Ranger(RangerSettings(CADENCE, SITES, sigma=0.0, scale=1.07), stream(1, "r"))
    reading = ranger.measure(straight(0.0))
    assert reading is not None
    assert reading.distance == pytest.approx(53.5)


def test_a_lost_beacon_is_silent_in_its_window_alone() -> None:
    loss = BeaconLoss(9, Window(1.0, 2.0))
    ranger = Ranger(RangerSettings(CADENCE, SITES, sigma=0.0, losses=(loss,)), stream(1, "r"))
    heard = [ranger.measure(straight(count / 2.0)) for count in range(8)]
    assert [None if reading is None else reading.beacon.id for reading in heard] == [
        3,
        9,
        3,
        None,
        3,
        9,
        3,
        9,
    ]


def test_a_stray_range_is_a_single_one() -> None:
    settings = RangerSettings(CADENCE, SITES[1:], sigma=0.0, strays=(StrayRange(0.12, 300.0),))
    ranger = Ranger(settings, stream(1, "r"))
    heard = [ranger.measure(straight(count / 20.0, speed=0.0)) for count in range(6)]
    assert [reading.distance for reading in heard if reading] == pytest.approx([12, 12, 12, 312, 12, 12])
