from __future__ import annotations

from itertools import pairwise

from drivers.clock import EXCHANGES_NEEDED, DeviceClocks
from drivers.mavlink.timesync import PATIENCE, TimeSync, TimeSynchroniser
from drivers.sample import SECOND


def test_a_request_is_answered_with_our_clock_and_theirs() -> None:
    request = TimeSync(0, 42)
    assert request.asks
    assert request.answer(1_000) == TimeSync(1_000, 42)
    assert not TimeSync(1_000, 42).asks


def run(seconds: int, peer_offset: int | None) -> tuple[TimeSynchroniser, DeviceClocks, list[int]]:
    """Step through time; the peer answers after 4 ms, or not at all. Return when it was asked."""
    synchroniser, clocks, asked = TimeSynchroniser(), DeviceClocks(), list[int]()
    for now in range(SECOND, (seconds + 1) * SECOND, SECOND // 1_000):
        request = synchroniser.request(now, clocks)
        if request is None:
            continue
        assert request.tc1 == 0
        asked.append(now)
        if peer_offset is not None:
            answer = TimeSync(now + 2_000_000 - peer_offset, request.ts1)
            synchroniser.answered_by(answer, now + 4_000_000, clocks)
    return synchroniser, clocks, asked


def test_ten_a_second_until_the_clock_is_known_then_one() -> None:
    synchroniser, clocks, asked = run(10, peer_offset=500_000_000)
    assert clocks.boot.method == "timesync"
    assert clocks.boot.offset == 0.5
    gaps = [later - earlier for earlier, later in pairwise(asked)]
    assert gaps[: EXCHANGES_NEEDED - 2] == [SECOND // 10] * (EXCHANGES_NEEDED - 2)
    assert set(gaps[EXCHANGES_NEEDED:]) == {SECOND}
    assert synchroniser.answered == len(asked)


def test_a_peer_that_does_not_answer_is_asked_rarely() -> None:
    _, clocks, asked = run(30, peer_offset=None)
    assert clocks.boot.method == "arrival"
    assert len(asked) < PATIENCE + 30


def test_answers_to_others_are_not_ours() -> None:
    synchroniser, clocks = TimeSynchroniser(), DeviceClocks()
    request = synchroniser.request(SECOND, clocks)
    assert request is not None
    synchroniser.answered_by(TimeSync(5, 77), SECOND + 10, clocks)
    synchroniser.answered_by(TimeSync(5, request.ts1), SECOND + 20, clocks)
    synchroniser.answered_by(TimeSync(5, request.ts1), SECOND + 30, clocks)  # once is enough
    assert (synchroniser.answered, synchroniser.unasked) == (1, 2)
