"""Deadlines and missed ticks, against exact rational arithmetic."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.schedule import Schedule


def test_deadlines_do_not_drift() -> None:
    """Tick 10^6 at 30 Hz lies where exact arithmetic puts it, to the nanosecond."""
    schedule = Schedule(30.0, 17)
    for _ in range(1_000):
        schedule.advance(schedule.deadline_ns)
    assert schedule.deadline_ns == 17 + round(Fraction(1_000 * 10**9, 30))
    assert schedule.missed == 0


def test_late_tick_is_done_and_the_next_keeps_its_time() -> None:
    schedule = Schedule(100.0, 0)
    schedule.advance(15_000_000)  # tick 0 ended 5 ms after tick 1 was due
    assert schedule.deadline_ns == 10_000_000
    schedule.advance(16_000_000)
    assert schedule.deadline_ns == 20_000_000
    assert schedule.missed == 0


def test_stall_skips_and_counts() -> None:
    """A stall of 95 ms at 100 Hz: ticks 1 to 8 never run, tick 9 runs late, then tick 10 on time."""
    schedule = Schedule(100.0, 0)
    schedule.advance(95_000_000)
    assert schedule.deadline_ns == 90_000_000
    assert schedule.missed == 8
    schedule.advance(96_000_000)
    assert schedule.deadline_ns == 100_000_000
    assert schedule.missed == 8


@given(st.lists(st.integers(0, 300_000_000), max_size=50), st.sampled_from([1.0, 10.0, 33.3, 100.0, 1000.0]))
def test_every_tick_is_done_or_missed_and_never_two_at_once(durations: list[int], rate: float) -> None:
    schedule, now = Schedule(rate, 0), 0
    for done, duration in enumerate(durations, 1):
        now = max(now, schedule.deadline_ns) + duration
        schedule.advance(now)
        period = 1e9 / rate
        assert schedule.deadline_ns > now - period - 1
        assert round(schedule.deadline_ns / period) == done + schedule.missed


def test_refuses_no_rate() -> None:
    with pytest.raises(ValueError, match="rate"):
        Schedule(0.0, 0)
