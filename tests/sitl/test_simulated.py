"""Logs that ``sim_vehicle`` wrote, on any clone: telemetry and CAN frames of an invented rover, replayed together."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from service.replay import Plan, Run, replay
from service.replay.site import setting_of
from service.score import read_truth

PARTICLES = 1000


def written(folder: Path, scenario: str, seed: int, seconds: int) -> tuple[Path, ...]:
    """Have the simulator write a drive; return its logs."""
    stem = folder / scenario
    options = ["--seed", str(seed), "--seconds", str(seconds), "--write", str(stem)]
    subprocess.run([sys.executable, "-m", "sim_vehicle", scenario, *options], check=True, capture_output=True)
    logs = (stem.with_name(scenario + ".tlog"), stem.with_name(scenario + ".candump.log"))
    return tuple(log for log in logs if log.is_file() and log.stat().st_size > 0)


def run_of(logs: tuple[Path, ...], seed: int, out: Path | None = None) -> Run:
    setting = setting_of(logs, None, None)
    assert setting.truth is not None
    return replay(Plan(logs, setting.configuration, PARTICLES, read_truth(setting.truth), out), seed)


@pytest.mark.parametrize("seed", [1, 2])
def test_ranges_to_beacons_hold_the_rover(tmp_path: Path, seed: int) -> None:
    """90 s of wheels, a gyro with bias and ranges of 0.3 m, no GNSS: below 0.3 m, and the region holds the truth."""
    run = run_of(written(tmp_path, "beacons", seed, 90), seed)
    assert run.score.rmse_m is not None
    assert run.score.rmse_m <= 0.3
    assert run.score.coverage_95 is not None
    assert run.score.coverage_95 >= 0.85
    assert run.shadow.score.rmse_m is not None
    assert run.shadow.ticks > 800


def test_telemetry_and_bus_are_merged_and_the_same_bytes_come_again(tmp_path: Path) -> None:
    """40 s, GNSS on the bus lost after 20: both links are used, below 0.5 m, one seed one file."""
    logs = written(tmp_path, "demo", 3, 40)
    assert len(logs) == 2
    runs = [run_of(logs, 5, tmp_path / name) for name in ("a", "b")]
    assert runs[0].score.rmse_m is not None
    assert runs[0].score.rmse_m <= 0.5
    assert {name.split("/")[1] for name in runs[0].sensors} == {"autopilot", "bus"}
    files = [(tmp_path / name / "estimates_seed5.csv").read_bytes() for name in ("a", "b")]
    assert files[0] == files[1]
