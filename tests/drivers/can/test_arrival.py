"""Frames dated by the wall clock, whatever the wall clock does meanwhile."""

from __future__ import annotations

import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.can.arrival import ArrivalClock

NOW_NS, UNIX_NOW, MS = 10_000_000_000_000, 1_700_000_000.0, 1_000_000


def clock() -> ArrivalClock:
    """One whose queue was last empty 50 ms ago."""
    made = ArrivalClock()
    made.seen_empty(NOW_NS - 50 * MS)
    return made


@pytest.mark.parametrize("age", [0.0, 0.005, 0.049])
def test_a_stamp_in_the_window_is_believed(age: float) -> None:
    arrival = clock().arrival(UNIX_NOW - age, NOW_NS, UNIX_NOW)
    assert arrival == pytest.approx(NOW_NS - age * 1e9, abs=1000)


@pytest.mark.parametrize(
    "age",
    [
        3600.0,  # the wall clock was set forward between stamp and reading
        -3600.0,  # or back
        UNIX_NOW - 12.5,  # the adapter counts from its own start
        UNIX_NOW,  # or gives no stamp at all
        0.06,  # older than the last sight of an empty queue
    ],
)
def test_any_other_is_dated_by_its_reading(age: float) -> None:
    assert clock().arrival(UNIX_NOW - age, NOW_NS, UNIX_NOW) == NOW_NS


@given(st.floats(-1e12, 1e12))
def test_no_stamp_leads_out_of_the_window(stamp: float) -> None:
    assert NOW_NS - 50 * MS <= clock().arrival(stamp, NOW_NS, UNIX_NOW) <= NOW_NS


def test_a_real_stamp_of_this_moment() -> None:
    made = ArrivalClock()
    before = time.monotonic_ns()
    stamp = time.time()
    arrival = made.arrival(stamp, time.monotonic_ns(), time.time())
    assert before - MS <= arrival <= time.monotonic_ns()
