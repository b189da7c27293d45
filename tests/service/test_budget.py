"""Meters against numpy's percentiles, on a clock that the test owns."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.budget import Histogram, Meters, Ring

SECONDS = st.floats(1e-7, 200.0)


@given(st.lists(SECONDS, min_size=1, max_size=300), st.integers(1, 120))
def test_ring_equals_numpy_on_what_it_holds(values: list[float], capacity: int) -> None:
    ring = Ring(capacity)
    for value in values:
        ring.add(value)
    held = np.array(values[-capacity:])
    cost = ring.cost()
    expected = [np.quantile(held, share, method="inverted_cdf") for share in (0.5, 0.99, 1.0)]
    np.testing.assert_allclose([cost.median, cost.p99, cost.worst], 1e3 * np.array(expected), rtol=1e-12)


def test_empty_ring_costs_nothing() -> None:
    assert Ring(3).cost().worst == 0.0


def test_ring_needs_room() -> None:
    with pytest.raises(ValueError, match="room"):
        Ring(0)


@settings(deadline=None)  # a busy machine is no failure
@given(st.lists(st.floats(2e-6, 90.0), min_size=1, max_size=300), st.floats(0.01, 1.0))
def test_histogram_quantile_is_at_most_one_bin_above(values: list[float], probability: float) -> None:
    """Bins of ten per octave: never below the exact quantile, and at most 2^0.1 = 7.2 % above."""
    histogram = Histogram()
    for value in values:
        histogram.add(value)
    exact = float(np.quantile(values, probability, method="inverted_cdf"))
    assert exact * (1 - 1e-9) <= histogram.quantile(probability) <= exact * 2**0.1 * (1 + 1e-9)
    assert histogram.total == len(values)
    assert histogram.worst == max(values)


@given(st.lists(st.floats(-1.0, 1e6), max_size=50))
def test_histogram_loses_nothing(values: list[float]) -> None:
    histogram = Histogram()
    for value in values:
        histogram.add(value)
    assert histogram.total == len(values)


class Clock:
    def __init__(self) -> None:
        self.now = 5_000

    def __call__(self) -> int:
        return self.now


def test_laps_charge_their_stage_and_add_up() -> None:
    clock = Clock()
    meters = Meters(rate=10.0, processor_ns=clock)
    meters.begin()
    for stage, nanoseconds in (("ingest", 1_000), ("motion", 2_000), ("sensing", 3_000), ("motion", 500)):
        clock.now += nanoseconds
        meters.lap(stage)
    clock.now += 250
    cost = meters.end(lateness=0.001, duration=0.002)
    assert cost == pytest.approx(6.75e-6)
    assert meters.costs["motion"] == pytest.approx(2.5e-6)
    stages = meters.stages()
    assert stages["motion"].worst == pytest.approx(2.5e-3)
    assert stages["tick"].median == pytest.approx(6.75e-3)
    assert stages["resampling"].worst == 0.0
    assert meters.recent_lateness().median == pytest.approx(1.0)
    assert meters.lateness.worst == 0.001
    assert meters.durations.worst == 0.002


def test_only_the_last_second_counts() -> None:
    clock = Clock()
    meters = Meters(rate=10.0, processor_ns=clock)
    for tick in range(30):
        meters.begin()
        clock.now += 1_000_000 if tick < 20 else 1_000
        meters.lap("motion")
        meters.end(0.0, 0.0)
    assert meters.stages()["motion"].worst == pytest.approx(1e-3)
    assert meters.durations.total == 30


def test_a_stage_unheard_of_gets_a_ring() -> None:
    clock = Clock()
    meters = Meters(rate=10.0, processor_ns=clock)
    meters.begin()
    clock.now += 1_000
    meters.lap("map")
    meters.end(0.0, 0.0)
    assert meters.stages()["map"].worst == pytest.approx(1e-3)


def test_a_distribution_adds_up() -> None:
    """A thousand ticks of 1 ms and one of 50 ms: the bins hold all of them, the percentiles lie in their bins."""
    histogram = Histogram()
    for _ in range(1000):
        histogram.add(1e-3)
    histogram.add(50e-3)
    said = histogram.distribution()
    assert said.ticks == sum(count for _, count in said.bins) == 1001
    assert [count for _, count in said.bins] == [1000, 1]
    assert 1.0 <= said.median == said.p99 <= 1.0 * 2**0.1
    assert said.p9999 == said.worst == 50.0


def test_spent_is_the_time_since_the_tick_began() -> None:
    now = 0
    meters = Meters(10.0, lambda: now)
    meters.begin()
    now = 3_000_000
    assert meters.spent == pytest.approx(3e-3)
