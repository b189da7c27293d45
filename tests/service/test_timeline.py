"""The timeline gives back in order, and refuses what is late, from the future, or too much."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from service.timeline import FUTURE_TOLERANCE, Timeline

MS = 1_000_000


def test_releases_in_order_of_time_whatever_the_order_of_arrival() -> None:
    timeline: Timeline[str] = Timeline()
    for name, time in (("c", 30), ("a", 10), ("d", 40), ("b", 20)):
        assert timeline.insert(name, time * MS, 50 * MS) is None
    assert timeline.release(30 * MS) == [(10 * MS, "a"), (20 * MS, "b"), (30 * MS, "c")]
    assert timeline.release(100 * MS) == [(40 * MS, "d")]


def test_equal_times_keep_their_order_of_arrival() -> None:
    timeline: Timeline[int] = Timeline()
    for item in range(20):
        timeline.insert(item, 5 * MS, 5 * MS)
    assert [item for _, item in timeline.release(5 * MS)] == list(range(20))


def test_what_the_horizon_has_passed_is_late() -> None:
    timeline: Timeline[str] = Timeline()
    timeline.release(100 * MS)
    assert timeline.insert("at the horizon", 100 * MS, 120 * MS) == "late"
    assert timeline.insert("after it", 100 * MS + 1, 120 * MS) is None
    assert timeline.refused == {"late": 1}


def test_what_claims_to_be_from_the_future_is_refused() -> None:
    timeline: Timeline[str] = Timeline()
    assert timeline.insert("settling", 100 * MS + FUTURE_TOLERANCE, 100 * MS) is None
    assert timeline.insert("wrong", 100 * MS + FUTURE_TOLERANCE + 1, 100 * MS) == "future"
    assert timeline.refused == {"future": 1}


def test_does_not_grow_beyond_its_capacity() -> None:
    timeline: Timeline[int] = Timeline(capacity=10)
    reasons = [timeline.insert(item, item + 1, 1000) for item in range(15)]
    assert reasons == [None] * 10 + ["overflow"] * 5
    assert len(timeline) == 10


def test_the_horizon_never_moves_back() -> None:
    timeline: Timeline[int] = Timeline()
    timeline.release(100)
    timeline.release(50)
    assert timeline.insert(1, 70, 200) == "late"


@given(st.lists(st.tuples(st.integers(1, 10**6), st.integers(0, 10**6)), max_size=60))
def test_every_item_is_released_once_or_refused(steps: list[tuple[int, int]]) -> None:
    """Whatever the times and horizons: inserted = released + waiting, and the output is sorted."""
    timeline: Timeline[int] = Timeline()
    accepted: set[int] = set()
    released: list[int] = []
    times: list[int] = []
    for index, (time, horizon) in enumerate(steps):
        if timeline.insert(index, time, 10**6) is None:
            accepted.add(index)
        for passed, item in timeline.release(horizon):
            released.append(item)
            times.append(passed)
    for passed, item in timeline.release(10**7):
        released.append(item)
        times.append(passed)
    assert sorted(released) == sorted(accepted)
    assert times == sorted(times)
    assert len(accepted) + timeline.refused.total() == len(steps)
