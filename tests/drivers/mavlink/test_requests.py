from __future__ import annotations

from itertools import pairwise

import pytest

from drivers.mavlink.requests import (
    ACCEPTED,
    ANSWER_WITHIN,
    IN_PROGRESS,
    RAREST,
    SILENT_AFTER,
    TEMPORARILY_REJECTED,
    TRIES,
    IntervalRequest,
    MessageRequests,
    StreamRequest,
)
from drivers.sample import SECOND

ATTITUDE, WHEELS, RPM, BEACON = 30, 9000, 226, 513
DENIED, UNSUPPORTED, FAILED = 2, 3, 4


def test_one_question_is_open_at_a_time() -> None:
    requests = MessageRequests({"HEARTBEAT": 1.0, "ATTITUDE": 50.0, "RPM": 10.0})
    assert requests.due(0) == IntervalRequest(ATTITUDE, 20_000)
    assert requests.due(1) is None
    requests.acknowledged(IN_PROGRESS)
    assert requests.due(2) is None
    requests.acknowledged(ACCEPTED)
    assert requests.due(3) == IntervalRequest(RPM, 100_000)
    requests.acknowledged(ACCEPTED)
    assert requests.due(4) is None


def test_an_acknowledgement_of_nothing_is_harmless() -> None:
    requests = MessageRequests({"ATTITUDE": 50.0})
    requests.acknowledged(DENIED)
    assert requests.due(0) == IntervalRequest(ATTITUDE, 20_000)


@pytest.mark.parametrize("result", [DENIED, UNSUPPORTED, FAILED])
def test_where_refused_the_stream_is_asked_for(result: int) -> None:
    """And what was granted in the same stream is set again, since the stream's rate overrides it."""
    requests = MessageRequests({"ATTITUDE": 50.0, "WHEEL_DISTANCE": 25.0})
    requests.due(0)
    requests.acknowledged(ACCEPTED)
    assert requests.due(1) == IntervalRequest(WHEELS, 40_000)
    requests.acknowledged(result)
    assert requests.due(2) == StreamRequest(10, 25)
    assert requests.due(3) == IntervalRequest(ATTITUDE, 20_000)
    requests.acknowledged(ACCEPTED)
    assert requests.due(4) is None
    assert requests.refused == ["WHEEL_DISTANCE"]


def test_a_message_of_no_stream_is_given_up() -> None:
    requests = MessageRequests({"RANGING_BEACON": 20.0})
    requests.due(0)
    requests.acknowledged(UNSUPPORTED)
    assert all(requests.due(second * SECOND) is None for second in range(100))


def test_a_question_without_an_answer_is_repeated_then_taken_as_refused() -> None:
    requests = MessageRequests({"WHEEL_DISTANCE": 25.0})
    now = 0
    for _ in range(TRIES):
        assert requests.due(now) == IntervalRequest(WHEELS, 40_000)
        assert requests.due(now + ANSWER_WITHIN - 1) is None
        now += ANSWER_WITHIN
    assert requests.due(now) == StreamRequest(10, 25)


def test_a_lost_answer_does_not_matter_when_the_message_comes() -> None:
    requests = MessageRequests({"ATTITUDE": 50.0})
    for attempt in range(TRIES):
        requests.due(attempt * ANSWER_WITHIN)
        requests.heard(ATTITUDE, attempt * ANSWER_WITHIN + 1)
    assert requests.due(TRIES * ANSWER_WITHIN) is None
    assert requests.refused == []


def test_rejected_for_now_is_asked_again() -> None:
    requests = MessageRequests({"ATTITUDE": 50.0})
    requests.due(0)
    requests.acknowledged(TEMPORARILY_REJECTED)
    assert requests.due(1) == IntervalRequest(ATTITUDE, 20_000)


def test_what_falls_silent_is_asked_for_again_ever_more_rarely() -> None:
    requests = MessageRequests({"ATTITUDE": 50.0})
    requests.due(0)
    requests.acknowledged(ACCEPTED)
    requests.heard(ATTITUDE, SECOND)
    assert requests.due(SECOND + SILENT_AFTER) is None
    asked: list[int] = []
    for now in range(0, 600 * SECOND, SECOND):
        if requests.due(now) is not None:
            asked.append(now)
            requests.acknowledged(ACCEPTED)
    gaps = [later - earlier for earlier, later in pairwise(asked)]
    assert gaps == sorted(gaps)
    assert gaps[-1] >= RAREST
    requests.heard(ATTITUDE, 600 * SECOND)
    assert requests.due(600 * SECOND + SILENT_AFTER + 1) is not None  # patience is as short as at first


def test_after_a_reboot_everything_is_asked_for() -> None:
    requests = MessageRequests({"ATTITUDE": 50.0, "RANGING_BEACON": 20.0})
    requests.due(0)
    requests.acknowledged(ACCEPTED)
    requests.due(1)
    requests.acknowledged(UNSUPPORTED)
    requests.restart()
    assert requests.due(2) == IntervalRequest(ATTITUDE, 20_000)
    requests.acknowledged(ACCEPTED)
    assert requests.due(3) == IntervalRequest(BEACON, 50_000)


@pytest.mark.parametrize(
    ("rates", "complaint"),
    [({"ATITUDE": 5.0}, "rates.ATITUDE"), ({"RPM": 0.0}, "above 0"), ({"RPM": float("nan")}, "above 0")],
)
def test_wrong_rates_say_so(rates: dict[str, float], complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        MessageRequests(rates)
