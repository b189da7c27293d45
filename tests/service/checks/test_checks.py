"""Each question of a scenario: a run that deserves a yes, and the run that differs in that one thing and does not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from service.checks import Story, Teller, judge, read_events
from service.checks.check import Check
from service.estimate import Estimate, HealthState, MotionMode, SensorStatus
from tests.service.checks.runs import BEGIN, answers, seconds, told


def failed(checks: list[Check]) -> list[str]:
    return [check.name for check in checks if not check.passed]


def mirror(**changes: object) -> Story:
    time = seconds(120.0)
    before = time < 68.0
    ticks: dict = {
        "hypotheses": np.where(before, 2.0, 1.0),
        "health": np.where(before, "ambiguous", "tracking"),
        "events": ((60.0, "turn"), (65.0, "turned")),
    }
    error = np.where(before, 18.0, 0.4)
    return told(**{"error": error, **ticks, **changes})  # type: ignore[arg-type]


def test_mirror() -> None:
    time = seconds(120.0)
    assert failed(judge("mirror", mirror())) == []
    one = mirror(hypotheses=np.ones(1200))
    assert failed(judge("mirror", one)) == ["2 hypotheses in 90 % of 20 s before the turn"]
    sure = mirror(health=np.full(1200, "tracking"))
    assert failed(judge("mirror", sure)) == ["ambiguous in 90 % of 20 s before the turn"]
    undecided = mirror(hypotheses=np.where(time < 90.0, 2.0, 1.0))
    assert failed(judge("mirror", undecided)) == ["1 hypothesis from 5 s after the turn"]
    wrong = mirror(error=np.where(time < 90.0, 18.0, 0.4))
    assert failed(judge("mirror", wrong)) == ["the right one, within 3 m", "RMSE from then on at most 1 m"]


def kidnap(**changes: object) -> Story:
    time = seconds(120.0)
    found = time >= 14.0
    ticks: dict = {
        "error": np.where(found, 0.5, 2000.0),
        "resets": np.where(found, 1.0, 0.0),
        "health": np.where(found, "tracking", "lost"),
        "events": ((8.0, "evidence"), (60.0, "outlier"), (90.0, "outlier")),
    }
    return told(**{**ticks, **changes})  # type: ignore[arg-type]


def test_kidnap() -> None:
    time = seconds(120.0)
    assert failed(judge("kidnap", kidnap())) == []
    late = kidnap(
        error=np.where(time >= 20.0, 0.5, 2000.0), health=np.where(time >= 20.0, "tracking", "lost")
    )
    assert failed(judge("kidnap", late)) == ["right (5 m) within 10 s of evidence"]
    twice = kidnap(resets=np.where(time >= 14.0, 2.0, 0.0))
    assert failed(judge("kidnap", twice)) == ["one step of reset_counter"]
    never = kidnap(resets=np.zeros(1200))
    assert failed(judge("kidnap", never)) == ["one step of reset_counter"]
    moved = kidnap(error=np.where(time < 14.0, 2000.0, np.where((time > 90.2) & (time < 91.0), 7.0, 0.5)))
    assert answers(judge("kidnap", moved))["no outlier of 300 m moves it by 5 m"] == (False, 6.5)
    sure = kidnap(health=np.full(1200, "tracking"))
    assert failed(judge("kidnap", sure)) == ["tracking while 10 m off, s"]


def test_late_fix_need_not_jump_from_nearby() -> None:
    near = told(
        np.full(3600, 2.0), sigma=2.0, events=((300.0, "evidence"), (340.0, "outlier")), resets=np.zeros(3600)
    )
    assert failed(judge("late_fix", near)) == []
    time = seconds(360.0)
    far = told(np.where(time < 303.0, 9.0, 0.5), sigma=8.0, events=((300.0, "evidence"), (340.0, "outlier")))
    assert failed(judge("late_fix", far)) == ["one step of reset_counter"]


def spoof(**changes: object) -> Story:
    ticks: dict = {
        "error": np.full(4500, 4.0),
        "events": ((60.0, "spoof"), (360.0, "honest")),
        "flags": (("position/autopilot", 66.0, 372.0),),
    }
    return told(**{**ticks, **changes})  # type: ignore[arg-type]


def test_spoof() -> None:
    time = seconds(450.0)
    assert failed(judge("spoof", spoof())) == []
    dragged = spoof(error=np.where((time > 60.0) & (time < 80.0), 40.0, 4.0))
    assert failed(judge("spoof", dragged)) == ["flagged before 30 m of error"]
    unseen = spoof(flags=())
    assert "flagged before 30 m of error" in failed(judge("spoof", unseen))
    hasty = spoof(flags=(("position/autopilot", 66.0, 364.0),))
    assert failed(judge("spoof", hasty)) == ["trusted again 10 s after the honest return or later"]
    early = spoof(flags=(("position/autopilot", 20.0, 30.0), ("position/autopilot", 66.0, 372.0)))
    assert failed(judge("spoof", early)) == ["no flag before"]
    grudging = spoof(flags=(("position/autopilot", 66.0, np.inf),))
    assert failed(judge("spoof", grudging)) == ["trusted again before the end"]
    off = spoof(error=np.where(time > 300.0, 60.0, 4.0))
    assert failed(judge("spoof", off)) == ["at most 50 m off in 5 min", "within 5 m at the end"]


def test_jam() -> None:
    def run(error: float, flags: tuple[tuple[str, float, float], ...]) -> Story:
        return told(np.full(1800, error), events=((60.0, "jam"), (110.0, "honest")), flags=flags)

    assert failed(judge("jam", run(3.0, (("position/autopilot", 62.0, 122.0),)))) == []
    assert failed(judge("jam", run(5.0, (("position/autopilot", 62.0, 122.0),)))) == [
        "never more than 4 m off"
    ]
    assert failed(judge("jam", run(3.0, (("position/autopilot", 64.0, 122.0),)))) == ["flagged within 3 s"]
    assert failed(judge("jam", run(3.0, (("position/autopilot", 62.0, 130.0),)))) == [
        "trusted again within 15 s"
    ]


def test_slip() -> None:
    time = seconds(120.0)
    random = np.random.default_rng(5)
    error = np.hypot(*random.normal(0.0, 0.3, (2, 1200)))

    def run(since: float, scale: float = 1.0) -> Story:
        events = ((50.0, "slip"), (70.0, "grip"))
        return told(scale * error, sigma=0.3, events=events, slipping=(time > since) & (time < 70.0))

    assert failed(judge("slip", run(51.0))) == []
    assert failed(judge("slip", run(53.0))) == ["slip reported within 2 s"]
    assert failed(judge("slip", run(51.0, 1.5))) == ["NEES in its 95 % bounds"]
    assert "at most 2 m off" in failed(judge("slip", run(51.0, 4.0)))


def test_outage() -> None:
    time = seconds(60.0)
    events = ((20.0, "mavlink drop"), (28.0, "calm"), (40.0, "can drop"), (48.0, "calm"))
    health = np.where((time > 24.0) & (time < 30.0), "dead_reckoning", "tracking")
    assert failed(judge("outage", told(np.full(600, 1.0), events=events, health=health))) == []
    slow = np.where((time > 24.0) & (time < 35.0), "dead_reckoning", "tracking")
    again = answers(judge("outage", told(np.full(600, 1.0), events=events, health=slow)))
    assert again["tracking again within 5 s"] == (False, pytest.approx(6.9))
    holes = np.where((time > 30.0) & (time < 30.5), np.nan, 1.0)
    assert failed(judge("outage", told(holes, events=events, health=health))) == ["ticks without a position"]


def test_nothing_is_asked_of_other_scenarios() -> None:
    assert judge("demo", told(np.zeros(10))) == []


def estimate(time: float, **changes: object) -> Estimate:
    fields: dict = {
        "sequence": 0,
        "time": time,
        "monotonic_ns": 0,
        "health": HealthState.TRACKING,
        "reason": "",
        "level": 0,
        "position": (1.0, 2.0, 0.0),
        "velocity": (0.0, 0.0, 0.0),
        "heading": 0.0,
        "position_covariance": (1.0, 0.0, 0.0, 1.0, 0.0, 1.0),
        "velocity_covariance": (0.0,) * 6,
        "heading_variance": 0.1,
        "latitude": None,
        "longitude": None,
        "altitude": None,
        "radius95": 2.0,
        "hypotheses": 1,
        "particles": 10,
        "demanded": 10,
        "afforded": 10,
        "effective_sample_size": 10.0,
        "reset_counter": 0,
        "biases": {},
    }
    return Estimate(**{**fields, **changes})


def status(trust: float | None) -> SensorStatus:
    return SensorStatus("position/autopilot", 5.0, trust, 1, {}, None, None)


def test_a_run_is_told_with_its_flags_resets_and_seconds_in_each_health() -> None:
    teller = Teller()
    trusts = [None, 2.0, -1.0, -3.0, 0.5, -0.1, -0.2]
    for index, trust in enumerate(trusts):
        time = BEGIN + index
        health = HealthState.LOST if index == 3 else HealthState.TRACKING
        teller.add(
            estimate(
                time,
                health=health,
                reset_counter=int(index > 3),
                mode=MotionMode.SLIPPING if index == 5 else MotionMode.MOVING,
            )
        )
        assert teller.due(time)
        teller.ask(time, [status(trust)])
        assert not teller.due(time + 0.1)
    story = teller.story()
    assert [(flag.begin - BEGIN, flag.end - BEGIN) for flag in story.flags] == [(2.0, 4.0), (5.0, np.inf)]
    assert list(story.slipping) == [False] * 5 + [True, False]
    assert story.row() == {
        "health_seconds": {"lost": 1.0, "tracking": 6.0},
        "resets": 1,
        "flags": [
            {"sensor": "position/autopilot", "from": 2.0, "to": 4.0},
            {"sensor": "position/autopilot", "from": 5.0, "to": None},
        ],
    }


def test_events_are_read_and_a_wrong_table_says_where(tmp_path: Path) -> None:
    path = tmp_path / "x_events.csv"
    path.write_text("time_s,event\n1.5,spoof\n2,honest\n")
    assert read_events(path) == ((1.5, "spoof"), (2.0, "honest"))
    path.write_text("time_s,event\nx,spoof\n")
    with pytest.raises(ValueError, match="line 2: time_s must be a number"):
        read_events(path)
    path.write_text("time,event\n")
    with pytest.raises(ValueError, match="missing: time_s"):
        read_events(path)
