"""The reset counter: one step for one jump, whoever did it and however long its wake."""

from __future__ import annotations

import msgspec
import pytest

from service.estimate import Estimate, HealthState
from service.estimator.jumps import UNSEEN, Jumps

SECOND = 1_000_000_000
TICK = SECOND // 50
BEFORE = Estimate(
    sequence=0,
    time=0.0,
    monotonic_ns=0,
    health=HealthState.TRACKING,
    reason="",
    level=0,
    position=(0.0, 0.0, None),
    velocity=(10.0, 0.0, None),
    heading=0.0,
    position_covariance=(1.0, 0.0, None, 1.0, None, None),
    velocity_covariance=(1.0, 0.0, None, 1.0, None, None),
    heading_variance=0.1,
    latitude=None,
    longitude=None,
    altitude=None,
    radius95=2.0,
    hypotheses=1,
    particles=1,
    demanded=1,
    afforded=1,
    effective_sample_size=1.0,
    reset_counter=0,
    biases={},
)


def speak(jumps: Jumps, tick: int, north: float, health: HealthState = HealthState.TRACKING) -> int:
    jumps.spoken(
        msgspec.structs.replace(BEFORE, monotonic_ns=tick * TICK, position=(north, 0.0, None), health=health)
    )
    return jumps.steps


def test_motion_is_no_jump() -> None:
    jumps = Jumps()
    assert [speak(jumps, k, 0.2 * k) for k in range(200)] == [0] * 200


@pytest.mark.parametrize("ticks", [1, 5, 20])
def test_a_move_of_12_m_in_less_than_half_a_second_is_one_jump(ticks: int) -> None:
    jumps = Jumps()
    steps = [speak(jumps, k, 0.2 * k + 12.0 * min(1.0, max(0, k - 50) / ticks)) for k in range(300)]
    assert steps[50] == 0
    assert steps[50 + ticks :] == [1] * (250 - ticks)


def test_a_belief_that_tracks_may_go_as_far_as_it_said_and_one_that_reckoned_may_not() -> None:
    """12 m under a region of 20: a fix is for that; after dead reckoning it is the end of that, and a jump."""
    for health, expected in ((HealthState.TRACKING, 0), (HealthState.DEAD_RECKONING, 1)):
        jumps = Jumps()
        for k in range(300):
            jumps.spoken(
                msgspec.structs.replace(
                    BEFORE,
                    monotonic_ns=k * TICK,
                    position=(0.2 * k + 12.0 * (k > 200), 0.0, None),
                    radius95=20.0,
                    health=health if k <= 200 else HealthState.TRACKING,
                )
            )
        assert jumps.steps == expected


@pytest.mark.parametrize(("moved", "expected"), [(12.0, 0), (40.0, 1)])
def test_a_way_that_nobody_measured_ends_at_a_fix_within_what_was_claimed(
    moved: float, expected: int
) -> None:
    """Ten seconds of silence, a region that grows to 20 m, then a fix, and a region of 2 m at once."""
    jumps = Jumps(UNSEEN)
    for k in range(700):
        silent = 100 < k <= 600
        jumps.spoken(
            msgspec.structs.replace(
                BEFORE,
                monotonic_ns=k * TICK,
                position=(0.2 * k + moved * (k > 600), 0.0, None),
                radius95=2.0 + 18.0 * ((k - 100) / 500) if silent else 2.0,
                health=HealthState.DEAD_RECKONING if k > 150 and silent else HealthState.TRACKING,
            )
        )
    assert jumps.steps == expected


def test_a_slow_drift_back_is_none() -> None:
    """10 m in 10 s: 1 m/s beyond the velocity adds up to 1 m within the second that is remembered."""
    jumps = Jumps()
    assert {speak(jumps, k, 0.2 * k + 0.02 * k) for k in range(500)} == {0}


def test_what_is_done_on_purpose_counts_and_its_wake_does_not() -> None:
    jumps = Jumps()
    speak(jumps, 0, 0.0)
    jumps.done(TICK)
    assert speak(jumps, 1, 2000.0) == 1
    jumps.led(2 * TICK, 1)
    assert speak(jumps, 2, 2030.0) == 1
    jumps.done(3 * TICK)
    assert jumps.steps == 2


def test_another_leader_counts_once() -> None:
    jumps = Jumps()
    jumps.led(10 * SECOND, 1)
    jumps.led(11 * SECOND, 1)
    assert jumps.steps == 1
    jumps.led(20 * SECOND, 2)
    assert jumps.steps == 2


@pytest.mark.parametrize("health", [HealthState.WAITING, HealthState.CONVERGING])
def test_a_belief_without_a_place_does_not_jump_to_one(health: HealthState) -> None:
    jumps = Jumps()
    assert speak(jumps, 0, 0.0, health) == 0
    assert speak(jumps, 1, 80.0) == 0
    assert speak(jumps, 2, 80.2) == 0


def test_nothing_is_said_of_a_place_that_is_not_known() -> None:
    jumps = Jumps()
    speak(jumps, 0, 0.0)
    jumps.spoken(msgspec.structs.replace(BEFORE, monotonic_ns=TICK, position=(None, None, None)))
    assert speak(jumps, 2, 500.0) == 0


@pytest.mark.parametrize(
    ("first", "radius", "expected"),
    [
        (HealthState.DEAD_RECKONING, 2.0, 1),
        (HealthState.DEAD_RECKONING, 30.0, 0),
        (HealthState.WAITING, 2.0, 0),
        (HealthState.LOST, 2.0, 0),
    ],
)
def test_who_converges_jumps_only_from_a_place_that_it_had(
    first: HealthState, radius: float, expected: int
) -> None:
    """7 m in four ticks, the first of them still in the health before: late fixes after a told start, and others."""
    jumps = Jumps()
    for k in range(200):
        jumps.spoken(
            msgspec.structs.replace(
                BEFORE,
                monotonic_ns=k * TICK,
                position=(0.2 * k + 7.0 * min(1.0, max(0, k - 100) / 4), 0.0, None),
                radius95=radius,
                health=first if k <= 100 else HealthState.CONVERGING,
            )
        )
    assert jumps.steps == expected
