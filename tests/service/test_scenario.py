"""``beliefd scenario`` end to end: the simulator's bytes, the replay, the questions, in words and as JSON."""

from __future__ import annotations

import io
import json

import pytest
from rich.console import Console

from service.replay.run import Run
from service.replay.table import show_checks
from service.scenario import Play, command, run_once

SHORT = Play(seconds=12.0)


@pytest.fixture(scope="module")
def run() -> Run:
    return run_once("beacons", 2, SHORT)


def test_the_questions_of_the_scenario_are_answered(run: Run) -> None:
    names = [check.name for check in run.checks]
    assert names[:2] == ["RMSE at most 0.30 m", "93 to 99 % inside 95 %"]
    assert run.seed == 2
    found = {check.name: check.found for check in run.checks}
    assert found["RMSE at most 0.30 m"] == pytest.approx(run.score.rmse_m, abs=1e-3)
    assert run.story is not None
    assert run.story.time[-1] - run.story.time[0] == pytest.approx(12.0, abs=0.5)


def test_the_row_has_levels_flags_and_resets_beside_what_it_always_had(run: Run) -> None:
    row = json.loads(json.dumps(run.row()))
    assert {"rmse_m", "coverage_95", "nees_mean", "final_m", "health", "ticks"} <= set(row)
    assert {"coverage_50", "coverage_99", "nees_low", "nees_high", "log_score"} <= set(row)
    assert len(row["levels"]) == 100
    assert 0 < sum(row["levels"]) <= row["ticks"]
    assert row["resets"] == 0
    assert row["flags"] == []
    assert sum(row["health_seconds"].values()) == pytest.approx(row["ticks"] / 50.0, abs=0.2)
    assert row["checks"][0]["name"] == "RMSE at most 0.30 m"


def test_the_table_counts_the_seeds_that_passed(run: Run) -> None:
    out = io.StringIO()
    show_checks([run, run], Console(file=out, width=120))
    line = next(line for line in out.getvalue().splitlines() if "no step of reset_counter" in line)
    assert "2 of 2" in line


def test_a_switch_that_there_is_not_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert command("beacons", 1, as_json=False, play=Play(without=("luck",))) == 2
    said = " ".join(capsys.readouterr().out.split())
    switches = "hypotheses, recovery, trust, noise_learning, lasting_errors, motion_mode"
    assert f"--without luck: [honesty] has {switches}" in said
