"""Encoders: cumulative, in whole ticks, long by their scale, and spinning as much as the settings say."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_vehicle.chance import stream
from sim_vehicle.faults import Window
from sim_vehicle.sensors import Cadence, Slip, Wheels, WheelSettings
from tests.sim_vehicle.sensors.truths import straight

CADENCE = Cadence(50.0)


def test_the_counters_are_cumulative_and_scaled() -> None:
    wheels = Wheels(WheelSettings(CADENCE, scale=1.02, imbalance=0.01, tick=0.001), stream(1, "wheels"))
    readings = [wheels.measure(straight(count / 50.0)) for count in range(1, 5001)]
    lefts = [reading.left for reading in readings]
    assert lefts == sorted(lefts)
    way = 1.5 * 100.0
    assert readings[-1].left == pytest.approx(1.02 * 1.005 * way, abs=0.002)
    assert readings[-1].right == pytest.approx(1.02 * 0.995 * way, abs=0.002)


def test_the_counters_hold_whole_ticks_and_run_backwards_with_the_wheels() -> None:
    wheels = Wheels(WheelSettings(CADENCE, tick=0.01), stream(1, "wheels"))
    forward = wheels.measure(straight(1.0, 1.2345))
    assert forward.left == pytest.approx(1.23)
    back = wheels.measure(straight(2.0, 0.3))
    assert back.left == pytest.approx(0.60)


def test_slip_has_the_spread_of_the_settings() -> None:
    """The distance's sigma is slip v sqrt(2 tau (T - tau)) for T ≫ tau; 300 drives, five sigma."""
    drives = []
    for seed in range(300):
        wheels = Wheels(
            WheelSettings(CADENCE, slip=0.03, slip_correlation=1.0, tick=1e-6), stream(seed, "wheels")
        )
        for count in range(1, 501):
            reading = wheels.measure(straight(count / 10.0))
        drives.append(reading.left - 75.0)
    exact = 0.03 * 1.5 * math.sqrt(2.0 * 1.0 * (50.0 - 1.0))
    assert np.std(drives) == pytest.approx(exact, rel=5.0 / math.sqrt(2.0 * 300) + 0.02)
    assert abs(np.mean(drives)) < 5.0 * exact / math.sqrt(300)


def test_bursts_spin_the_wheels_now_and_then() -> None:
    settings = WheelSettings(CADENCE, burst_interval=20.0, burst_length=2.0, burst_slip=0.3)
    wheels = Wheels(settings, stream(4, "wheels"))
    counters = np.array([wheels.measure(straight(count / 50.0)).left for count in range(30_000)])
    shares = np.diff(counters[::50]) / 1.5 - 1.0
    spinning = shares > 0.05
    # 600 s, a burst every 22 s: some 27, each of 2 s on average; wide bounds, the seed is fixed.
    assert 0.03 < spinning.mean() < 0.25
    assert shares[~spinning] == pytest.approx(0.0, abs=0.05)


def test_a_declared_slip_lengthens_its_window_alone() -> None:
    settings = WheelSettings(CADENCE, slips=(Slip(Window(10.0, 30.0), 0.3),))
    wheels = Wheels(settings, stream(1, "wheels"))
    counted = [wheels.measure(straight(count / 50.0)).left for count in range(2001)]
    before, during, after = (
        counted[end] - counted[begin] for begin, end in ((0, 499), (499, 1499), (1499, 2000))
    )
    assert before == pytest.approx(1.5 * 9.98, abs=0.002)
    assert during == pytest.approx(1.3 * 1.5 * 20.0, abs=0.002)
    assert after == pytest.approx(1.5 * 10.02, abs=0.002)
