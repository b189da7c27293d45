"""Slow sensors are heard out; fast ones are looked at now and then, and take turns."""

from __future__ import annotations

from itertools import pairwise

from drivers.sample import SECOND
from service.estimator.attention import FEW, PATIENCE, SPACING, Attention

PERIOD = 20_000_000


def looked_at(rates: list[float], ticks: int) -> tuple[list[list[int]], list[int]]:
    """Return the times at which each of some sensors is looked at, and how many are in each tick of 50 a second."""
    attention = Attention()
    seen: list[list[int]] = [[] for _ in rates]
    spoken = [0] * len(rates)
    counts: list[int] = []
    for tick in range(1, ticks + 1):
        attention.next_tick()
        before = sum(map(len, seen))
        for sensor, rate in enumerate(rates):
            while spoken[sensor] * SECOND / rate < tick * PERIOD:
                time = round(spoken[sensor] * SECOND / rate)
                spoken[sensor] += 1
                if attention.wants(str(sensor), time):
                    seen[sensor].append(time)
        counts.append(sum(map(len, seen)) - before)
    return seen, counts


def test_slow_sensors_are_heard_out_however_many_there_are() -> None:
    seen, _ = looked_at([10.0] * 6 + [5.0], 500)
    assert [len(times) for times in seen] == [100] * 6 + [50]


def test_one_of_thirty_readings_a_second_is_heard_out_and_a_faster_one_is_not() -> None:
    assert len(looked_at([30.0], 500)[0][0]) == 300
    times = looked_at([200.0], 500)[0][0]
    assert min(later - time for time, later in pairwise(times)) >= SPACING
    assert len(times) > 300


def test_fast_sensors_take_turns_a_few_a_tick() -> None:
    """Four ranges in every tick: two of them are looked at in each, and each of them 25 times a second."""
    seen, counts = looked_at([50.0] * 4, 500)
    assert set(counts[5:]) == {FEW}
    assert {len(times) for times in seen} <= set(range(248, 253))
    gaps = [later - time for times in seen for time, later in pairwise(times)]
    assert max(gaps) <= PATIENCE + PERIOD


def test_a_clock_that_went_back_is_looked_at() -> None:
    attention = Attention()
    assert attention.wants("a", 10 * SECOND)
    assert not attention.wants("a", 10 * SECOND)
    assert attention.wants("a", 9 * SECOND)
