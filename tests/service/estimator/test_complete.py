"""Up to when nothing is missing: the sender who is behind decides, unless he has fallen silent."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from drivers.sample import SECOND
from service.estimator.complete import MOMENT, PATIENCE, Complete

LONG = 100 * SECOND


def test_one_sender_is_waited_for_no_longer_than_his_newest_reading() -> None:
    complete = Complete()
    assert complete.until(LONG, 10 * SECOND) == 10 * SECOND
    complete.heard("fixes", 12 * SECOND)
    assert complete.until(LONG, 10 * SECOND) == 12 * SECOND
    assert complete.until(LONG, 13 * SECOND) == 13 * SECOND


def test_of_two_the_one_behind_decides() -> None:
    complete = Complete()
    complete.heard("fixes", 12 * SECOND)
    complete.heard("ranges", 11 * SECOND)
    assert complete.until(LONG, 10 * SECOND) == 11 * SECOND


def test_who_has_fallen_silent_is_not_waited_for() -> None:
    complete = Complete()
    complete.heard("ranges", 1 * SECOND)
    complete.heard("fixes", 12 * SECOND)
    assert complete.until(LONG, 1 * SECOND + PATIENCE) == 1 * SECOND + PATIENCE
    assert complete.until(LONG, 1 * SECOND + PATIENCE + 1) == 12 * SECOND


@given(st.lists(st.tuples(st.sampled_from("abc"), st.integers(0, 100))))
def test_nothing_comes_late_that_is_sent_in_order_within_the_wait(told: list[tuple[str, int]]) -> None:
    """However the senders mix: who sends in order is never behind what was said to be complete."""
    complete, sent = Complete(), dict.fromkeys("abc", 0)
    for sender in sent:
        complete.heard(sender, 0)
    for sender, step in told:
        assert complete.until(LONG, 0) <= sent[sender]
        sent[sender] += step
        complete.heard(sender, sent[sender])


def test_a_moment_s_wait_is_kept() -> None:
    complete = Complete()
    complete.heard("ranges", 12 * SECOND)
    assert complete.until(11 * SECOND + MOMENT, 11 * SECOND) == 11 * SECOND
    assert complete.until(11 * SECOND + MOMENT + 1, 11 * SECOND) == 12 * SECOND
