"""What stands beside a run: the shadow in the table and in JSON, the trace of its innovations, the progress."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from service.replay import Plan, Run, replay, show, summary
from service.replay.bars import Advance
from service.replay.command import as_json, command
from service.replay.site import setting_of
from service.score import read_truth


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ...]:
    """Half a minute among beacons, no GNSS."""
    stem = tmp_path_factory.mktemp("beside") / "beacons"
    options = ["--seed", "4", "--seconds", "30", "--write", str(stem)]
    subprocess.run(
        [sys.executable, "-m", "sim_vehicle", "beacons", *options], check=True, capture_output=True
    )
    logs = (stem.with_name("beacons.tlog"), stem.with_name("beacons.candump.log"))
    return tuple(log for log in logs if log.is_file() and log.stat().st_size)


@pytest.fixture(scope="module")
def run(drive: tuple[Path, ...]) -> Run:
    setting = setting_of(drive, None, None)
    assert setting.truth is not None
    return replay(Plan(drive, setting.configuration, 1000, read_truth(setting.truth), None, 0), 0)


def test_the_shadow_is_scored_beside_the_particles(run: Run) -> None:
    said = json.loads(as_json([run]))
    shadow = said["runs"][0]["shadow"]
    assert set(shadow) >= {"rmse_m", "coverage_95", "nees_mean", "max_m", "gated", "accepted", "ticks"}
    assert 0.0 < shadow["rmse_m"] < 1.0
    assert 150 < shadow["ticks"] <= 301
    assert said["summary"]["shadow"]["rmse_m"]["mean"] == shadow["rmse_m"]
    assert said["summary"]["shadow"]["gated"]["mean"] == sum(shadow["gated"].values())


def test_the_table_has_a_row_for_it(run: Run) -> None:
    out = io.StringIO()
    show([run], Console(file=out, width=120), "beacons")
    row = next(line.split() for line in out.getvalue().splitlines() if line.strip().startswith("EKF  "))
    assert run.shadow.score.rmse_m is not None
    assert row[1] == f"{round(run.shadow.score.rmse_m, 4):.3f}"  # as the report rounds it
    assert "real time" in out.getvalue()


def test_the_spread_over_seeds_holds_the_shadows(run: Run) -> None:
    out = io.StringIO()
    show([run, run], Console(file=out, width=80), "beacons")
    first = [line[:9].split() for line in out.getvalue().splitlines()]
    assert ["EKF"] in first
    assert ["EKF", "max"] in first
    assert summary([run, run])["shadow"]["rmse_m"]["sd"] == 0.0  # pyright: ignore[reportIndexIssue]


def test_a_trace_has_a_row_a_tick_and_normalised_innovations(run: Run) -> None:
    trace = run.trace
    assert trace is not None
    assert trace.ticks["time"].size == run.ticks
    assert np.isfinite(trace.ticks["north"][-1])
    assert set(trace.slow) == set(run.biases)
    assert set(trace.innovations) == {name for name, (used, _) in run.sensors.items() if used}
    every = [r.value / r.sigma for r in trace.innovations.values() if r.dimensions == 1]
    sizes = np.concatenate(every)
    sizes = sizes[np.isfinite(sizes)]
    assert sizes.size > 200
    # of a consistent filter the spread is one; outliers and correlated errors leave room about it
    assert 0.5 < np.quantile(np.abs(sizes), 0.68) < 1.5


def test_only_the_seed_asked_for_is_traced(drive: tuple[Path, ...]) -> None:
    setting = setting_of(drive, None, None)
    assert replay(Plan(drive, setting.configuration, 300, None, None, 1), 0).trace is None


def test_progress_adds_up_over_the_seeds() -> None:
    advance = Advance(2)
    advance.note(0, 0.5, 10.0)
    assert advance.done == "0 of 2 seeds"
    advance.note(1, 1.0, 20.0)
    assert advance.completed == 1.5
    assert advance.done == "1 of 2 seeds"
    assert advance.speed.endswith("real time")
    assert Advance(1).done == ""


def test_the_command_writes_a_report(drive: tuple[Path, ...], tmp_path: Path) -> None:
    path = tmp_path / "new" / "report.html"
    assert command(list(drive), None, None, 1, None, path, False, 300) == 0
    assert path.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


def test_without_bokeh_the_report_is_refused_before_the_replay(
    drive: tuple[Path, ...],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sys.modules["service.replay.command"], "find_spec", lambda name: None)
    assert command(list(drive), None, None, 1, None, tmp_path / "r.html", False, 300) == 1
    assert "beliefd[view]" in capsys.readouterr().out
    assert not (tmp_path / "r.html").exists()
