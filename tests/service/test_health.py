"""Every state of health that the daemon can reach is entered and left here, with its reason."""

from __future__ import annotations

from dataclasses import replace

from service.estimate import HealthState
from service.health import CONVERGED_RADIUS, LOST_RADIUS, SILENCE, Facts, HealthMonitor

SECOND = 1_000_000_000


def facts(
    now: float,
    radius: float | None = 1.0,
    *,
    started: bool = True,
    missing: list[str] | None = None,
    afforded: int = 5000,
) -> Facts:
    return Facts(round(now * SECOND), started, missing or [], radius, afforded, 200)


def agreeing(monitor: HealthMonitor, start: float, seconds: float, surprise: float = 0.02) -> float:
    """Feed ten measurements a second for a while; return the time after the last."""
    steps = round(seconds * 10)
    for k in range(steps):
        monitor.measured(round((start + k / 10) * SECOND), "range/a/1", surprise)
    return start + steps / 10


def test_waits_for_data_and_says_for_what() -> None:
    monitor = HealthMonitor()
    assert (
        monitor.judge(facts(0, None, started=False, missing=["odometry", "range/a"])) is HealthState.WAITING
    )
    assert "odometry" in monitor.reason
    assert "range/a" in monitor.reason


def test_converges_then_tracks() -> None:
    monitor = HealthMonitor()
    now = agreeing(monitor, 0, 2)
    assert monitor.judge(facts(now, 2 * CONVERGED_RADIUS)) is HealthState.CONVERGING
    assert monitor.judge(facts(now, 0.5 * CONVERGED_RADIUS)) is HealthState.TRACKING
    assert monitor.judge(facts(now, 2 * CONVERGED_RADIUS)) is HealthState.TRACKING
    assert monitor.judge(facts(now, 2 * LOST_RADIUS)) is HealthState.CONVERGING


def test_dead_reckons_without_absolute_measurements() -> None:
    monitor = HealthMonitor()
    assert monitor.judge(facts(0)) is HealthState.DEAD_RECKONING
    now = agreeing(monitor, 1, 2)
    assert monitor.judge(facts(now)) is HealthState.TRACKING
    later = now + SILENCE / SECOND + 0.2
    assert monitor.judge(facts(later)) is HealthState.DEAD_RECKONING
    assert "range/a/1" in monitor.reason
    monitor.measured(round(later * SECOND), "range/a/1", 0.02)
    assert monitor.judge(facts(later)) is HealthState.TRACKING


def test_a_long_horizon_is_no_silence() -> None:
    """Behind a horizon of 5 s the newest measurement there can be is 5 s old."""
    monitor = HealthMonitor()
    now = agreeing(monitor, 0, 2)
    late = facts(now + 5.0)
    assert monitor.judge(late) is HealthState.DEAD_RECKONING
    assert monitor.judge(replace(late, delay=5 * SECOND)) is HealthState.TRACKING
    assert monitor.judge(replace(facts(now + 8.2), delay=5 * SECOND)) is HealthState.DEAD_RECKONING


def test_waiting_with_nothing_missing_still_has_a_reason() -> None:
    monitor = HealthMonitor()
    assert monitor.judge(facts(0, None, started=False)) is HealthState.WAITING
    assert monitor.reason.endswith("start from")


def test_is_lost_when_the_measurements_disagree_and_found_when_they_agree() -> None:
    monitor = HealthMonitor()
    now = agreeing(monitor, 0, 3)
    now = agreeing(monitor, now, 8, surprise=0.99)
    assert monitor.judge(facts(now)) is HealthState.LOST
    assert "disagree" in monitor.reason
    now = agreeing(monitor, now, 8)
    assert monitor.judge(facts(now)) is HealthState.TRACKING


def clutter(monitor: HealthMonitor, start: float, seconds: float) -> float:
    """Feed five sights a second that fit nothing, of a sensor of which two fifths do not; return the time after."""
    steps = round(seconds * 5)
    for k in range(steps):
        monitor.measured(
            round((start + k / 5) * SECOND), "range_bearing/camera", 1.0, worth=0.3, outliers=0.4
        )
    return start + steps / 5


def test_outliers_that_were_stated_make_nothing_lost() -> None:
    """Half a minute of other robots: what fits nothing says nothing, so the belief lives on odometry alone."""
    monitor = HealthMonitor()
    now = clutter(monitor, agreeing(monitor, 0, 3), 30)
    assert monitor.judge(facts(now)) is HealthState.DEAD_RECKONING
    assert "may all be outliers" in monitor.reason
    several = replace(facts(now), ambiguity="2 hypotheses, 61 % and 39 %, 14 m apart")
    assert monitor.judge(several) is HealthState.AMBIGUOUS
    assert "may all be outliers" in monitor.reason
    assert monitor.reason.startswith(several.ambiguity)
    now = agreeing(monitor, now, 3)
    assert monitor.judge(facts(now)) is HealthState.TRACKING


def test_outliers_that_another_place_explains_make_it_lost() -> None:
    """And lost it stays when that place is given up again, until the measurements agree."""
    monitor = HealthMonitor()
    now = clutter(monitor, agreeing(monitor, 0, 3), 30)
    elsewhere = "another place explains the last 8 better"
    assert monitor.judge(replace(facts(now), elsewhere=elsewhere)) is HealthState.LOST
    assert monitor.reason.endswith(elsewhere)
    assert monitor.judge(facts(now)) is HealthState.LOST
    now = agreeing(monitor, now, 3)
    assert monitor.judge(replace(facts(now), elsewhere=elsewhere)) is HealthState.TRACKING


def test_outliers_for_many_minutes_are_too_many_for_any_share() -> None:
    monitor = HealthMonitor()
    now = clutter(monitor, agreeing(monitor, 0, 3), 600)
    assert monitor.judge(facts(now)) is HealthState.LOST


def test_a_single_outlier_changes_nothing() -> None:
    monitor = HealthMonitor()
    now = agreeing(monitor, 0, 5)
    monitor.measured(round(now * SECOND), "range/a/1", 1.0)
    assert monitor.judge(facts(now)) is HealthState.TRACKING


def test_a_few_readings_prove_nothing_either_way() -> None:
    for surprise in (0.0, 1.0):
        monitor = HealthMonitor()
        for k in range(5):
            monitor.measured(k * SECOND, "range/a/1", surprise)
        assert monitor.judge(facts(4.1)) is HealthState.CONVERGING
        assert "5 measurements" in monitor.reason


def test_a_wrong_start_is_never_called_tracking() -> None:
    """Measurements that disagree from the first on: converging while they are few, then lost, within a second."""
    monitor = HealthMonitor()
    states: list[HealthState] = []
    for k in range(30):
        monitor.measured(round(k / 10 * SECOND), "range/a/1", 0.97)
        states.append(monitor.judge(facts(k / 10)))
    assert states[:9] == [HealthState.CONVERGING] * 9
    assert states[9:] == [HealthState.LOST] * 21


def test_between_agreeing_and_disagreeing_it_stays_what_it_was() -> None:
    monitor = HealthMonitor()
    now = agreeing(monitor, 0, 3)
    now = agreeing(monitor, now, 20, surprise=0.65)
    assert monitor.judge(facts(now)) is HealthState.TRACKING
    assert "65% of the measurements" in monitor.reason
    now = agreeing(monitor, now, 10, surprise=1.0)
    assert monitor.judge(facts(now)) is HealthState.LOST
    now = agreeing(monitor, now, 20, surprise=0.65)
    assert monitor.judge(facts(now)) is HealthState.LOST
    now = agreeing(monitor, now, 20)
    assert monitor.judge(facts(now)) is HealthState.TRACKING


def test_tracking_says_what_was_never_heard() -> None:
    monitor = HealthMonitor()
    now = agreeing(monitor, 0, 3)
    assert monitor.judge(facts(now, missing=["yaw rate"])) is HealthState.TRACKING
    assert "never heard: yaw rate" in monitor.reason


def test_starves_when_the_budget_affords_too_few() -> None:
    monitor = HealthMonitor()
    now = agreeing(monitor, 0, 2)
    assert monitor.judge(facts(now, afforded=100)) is HealthState.STARVED
    assert "100 particles" in monitor.reason
    assert monitor.judge(facts(now)) is HealthState.TRACKING


def test_a_restart_forgets() -> None:
    monitor = HealthMonitor()
    agreeing(monitor, 0, 8, surprise=1.0)
    monitor.restart()
    assert monitor.judge(facts(9)) is HealthState.DEAD_RECKONING


def test_is_ambiguous_as_long_as_several_places_count() -> None:
    """It goes before dead reckoning, and after a loss: a belief that no measurement fits is not merely ambiguous."""
    monitor, several = HealthMonitor(), "2 hypotheses, 61 % and 39 %, 14 m apart"
    now = agreeing(monitor, 0, 2)
    assert monitor.judge(replace(facts(now, 15.0), ambiguity=several)) is HealthState.AMBIGUOUS
    assert monitor.reason == several
    silent = replace(facts(now + 10.0, 15.0), ambiguity=several)
    assert monitor.judge(silent) is HealthState.AMBIGUOUS
    assert several in monitor.reason
    assert "no absolute measurement" in monitor.reason
    assert monitor.judge(facts(now)) is HealthState.TRACKING
    now = agreeing(monitor, now, 6, surprise=1.0)
    assert monitor.judge(replace(facts(now), ambiguity=several)) is HealthState.LOST


def test_converges_while_the_place_is_searched_for_and_until_there_are_readings() -> None:
    """With no place at all, whatever arrives; then by what the search heard, though the belief heard nothing yet."""
    monitor = HealthMonitor()
    searching = replace(facts(1, 120.0, missing=["odometry"]), searching="searching the area")
    assert monitor.judge(searching) is HealthState.CONVERGING
    assert monitor.reason == "searching the area; never heard: odometry"
    monitor.restart()
    monitor.heard(round(1.5 * SECOND))
    assert monitor.judge(facts(2)) is HealthState.CONVERGING
    assert monitor.judge(facts(2 + SILENCE / SECOND)) is HealthState.DEAD_RECKONING
    now = agreeing(monitor, 6, 2)
    assert monitor.judge(facts(now)) is HealthState.TRACKING
