"""Totals over time: interpolated, held for a while, honest about gaps and counters that restart."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.sample import SECOND
from service.estimator.track import GAP, RateTrack, TotalTrack

MS = 1_000_000


@given(
    st.lists(st.tuples(st.integers(1, 200), st.floats(-2, 2)), min_size=2, max_size=30),
    st.floats(0, 1),
    st.floats(0, 1),
)
def test_totals_interpolate_as_numpy_does(steps: list[tuple[int, float]], a: float, b: float) -> None:
    track = TotalTrack()
    times = np.cumsum([ms for ms, _ in steps]) * MS
    totals = np.cumsum([step for _, step in steps])
    for time, total in zip(times, totals, strict=True):
        assert track.append(int(time), (float(total),), 0)
    start, end = sorted(int(times[0] + share * (times[-1] - times[0])) for share in (a, b))
    expected = np.interp(end, times, totals) - np.interp(start, times, totals)
    motion = track.between(start, end)
    assert motion.total == pytest.approx(expected, abs=1e-9)
    assert motion.unknown == 0.0


def test_rates_integrate_by_the_trapezoidal_rule() -> None:
    track = RateTrack()
    for k in range(101):
        track.append(k * 10 * MS, 2.0 * k / 100)
    assert track.between(0, SECOND).total == pytest.approx(1.0)


def test_a_rate_is_held_for_a_while_and_then_unknown() -> None:
    track = RateTrack()
    for k in range(11):
        track.append(k * 100 * MS, 3.0)
    held = track.between(SECOND, SECOND + GAP)
    assert held.total == pytest.approx(3.0 * GAP / SECOND)
    assert held.unknown == 0.0
    beyond = track.between(SECOND, SECOND + GAP + 2 * SECOND)
    assert beyond.total == pytest.approx(3.0 * GAP / SECOND)
    assert beyond.unknown == pytest.approx(2.0)


def test_a_gap_between_rates_is_unknown_beyond_its_hold() -> None:
    track = RateTrack()
    track.append(0, 1.0)
    track.append(3 * SECOND, 1.0)
    motion = track.between(0, 3 * SECOND)
    assert motion.total == pytest.approx(GAP / SECOND)
    assert motion.unknown == pytest.approx(3.0 - GAP / SECOND)


def test_a_counter_that_restarts_loses_only_what_it_missed() -> None:
    track = TotalTrack()
    track.append(0, (100.0,), 0)
    track.append(SECOND, (101.0,), 0)
    track.append(2 * SECOND, (0.0,), 1)
    track.append(3 * SECOND, (1.5,), 1)
    motion = track.between(0, 3 * SECOND)
    assert motion.total == pytest.approx(2.5)
    assert motion.unknown == pytest.approx(1.0)


def test_a_track_that_never_heard_anything_knows_nothing() -> None:
    motion = RateTrack().between(SECOND, 3 * SECOND)
    assert motion.total == 0.0
    assert motion.unknown == pytest.approx(2.0)
