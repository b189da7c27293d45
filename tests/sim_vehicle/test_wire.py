"""The way of a frame: latency, order, loss, faults."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_vehicle.chance import stream
from sim_vehicle.faults import Fault, Faults, Kind, Window
from sim_vehicle.wire import Wire, WireSettings


def wire(settings: WireSettings, *faults: Fault) -> Wire:
    return Wire(settings, Faults("mavlink", faults, stream(1, "faults")), stream(1, "wire"))


def test_frames_arrive_in_order_and_never_before_the_latency() -> None:
    line = wire(WireSettings(latency=0.002, jitter=0.01, spacing=0.0001))
    sent = np.linspace(0.0, 10.0, 5000)
    arrivals = [line.carry(float(time), b"x")[0].time for time in sent]
    assert all(arrival >= time + 0.002 for arrival, time in zip(arrivals, sent, strict=True))
    assert np.diff(arrivals).min() >= 0.0001 - 1e-12


def test_the_mean_delay_is_latency_and_jitter() -> None:
    """Far apart, frames do not wait for each other; 5,000 gamma delays, bound five sigma of the mean."""
    line = wire(WireSettings(latency=0.002, jitter=0.01))
    delays = [line.carry(float(time), b"x")[0].time - time for time in range(5000)]
    assert np.mean(delays) == pytest.approx(0.012, abs=5.0 * 0.01 / math.sqrt(2.0 * 5000))


def test_losses_are_counted() -> None:
    """10,000 frames at a loss of 5 %: five sigma are 109; fails by chance less than once in 10^6."""
    line = wire(WireSettings(loss=0.05))
    arrived = sum(len(line.carry(float(time), b"x")) for time in range(10_000))
    assert line.sent == 10_000
    assert line.lost == 10_000 - arrived
    assert abs(line.lost - 500) < 109


def test_faults_drop_repeat_delay_and_corrupt() -> None:
    settings = WireSettings(latency=0.01)
    assert wire(settings, Fault("mavlink", Kind.DROP)).carry(1.0, b"abc") == []
    assert wire(settings, Fault("mavlink", Kind.REPEAT)).carry(1.0, b"abc") == [(1.01, b"abc")] * 2
    assert wire(settings, Fault("mavlink", Kind.DELAY, delay=0.2)).carry(1.0, b"abc")[
        0
    ].time == pytest.approx(1.21)
    spoilt = [wire(settings, Fault("mavlink", Kind.CORRUPT)).carry(1.0, bytes(30))[0].frame][0]
    assert spoilt != bytes(30)
    assert len(spoilt) == 30


def test_reordered_frames_pass_each_other_and_hold_up_nobody() -> None:
    """1,000 frames 10 ms apart that lag by up to 0.2 s: most are overtaken, and the next one is on time."""
    line = wire(WireSettings(latency=0.01), Fault("mavlink", Kind.REORDER, Window(stop=10.0), delay=0.2))
    sent = [count / 100.0 for count in range(1000)]
    arrivals = [line.carry(time, b"x")[0].time for time in sent]
    lags = np.array(arrivals) - np.array(sent) - 0.01
    assert lags.min() >= -1e-12
    assert lags.max() < 0.2
    assert np.mean(lags) == pytest.approx(0.1, abs=5.0 * 0.2 / math.sqrt(12.0 * 1000))
    assert np.count_nonzero(np.diff(arrivals) < 0.0) > 300
    assert line.carry(10.0, b"x")[0].time == pytest.approx(10.01)
