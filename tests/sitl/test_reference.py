"""ArduPilot's rover and its jammed twin, on any clone: real telemetry through the real path, against the truth.

The copies in ``data/`` hold the messages that an estimate is made of (``trim.py``). The bounds leave a margin of a
third or more to what was measured over seeds; the figures themselves stand in docs/accuracy.md.
"""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from service.replay import Plan, Run, replay
from service.replay.site import setting_of
from service.score import read_truth

from .trim import MOST_BYTES, entries

DATA = Path(__file__).parent / "data"
ROVER, JAM = DATA / "sitl_rover.tlog", DATA / "sitl_jam.tlog"
PARTICLES = 1000


def run_of(log: Path, seed: int, out: Path | None = None, config: Path | None = None) -> Run:
    setting = setting_of((log,), config, log.with_name(log.stem + "_truth.csv") if out is None else None)
    truth = read_truth(setting.truth) if setting.truth is not None else None
    return replay(Plan((log,), setting.configuration, PARTICLES, truth, out), seed)


@pytest.mark.parametrize("seed", [0, 1])
def test_wheels_gyro_and_fixes_follow_the_rover(seed: int) -> None:
    """967 m with GNSS that is late: below 0.19 m (its own EKF3: 0.24), and tracking throughout."""
    run = run_of(ROVER, seed)
    assert run.score.rmse_m is not None
    assert run.score.rmse_m <= 0.19
    assert run.score.max_m is not None
    assert run.score.max_m <= 0.6
    assert run.score.coverage_95 is not None
    assert run.score.coverage_95 >= 0.93
    assert run.health["tracking"] > 0.95
    value, sigma = run.biases["odometry_scale"]
    assert value == pytest.approx(1.0, abs=max(0.01, 4 * sigma))


@pytest.mark.parametrize("seed", [0, 1])
def test_jamming_is_outvoted_and_said(seed: int) -> None:
    """48 s of fixes up to 2.4 km wrong that claim 0.3 m: the receiver is found out, and health does not hide it."""
    run = run_of(JAM, seed)
    assert run.score.rmse_m is not None
    assert run.score.rmse_m <= 0.3
    assert run.score.max_m is not None
    assert run.score.max_m <= 1.0
    assert run.score.coverage_95 is not None
    assert run.score.coverage_95 >= 0.93
    refused = next(refused for name, (_, refused) in run.sensors.items() if name.startswith("position"))
    assert refused["distrusted"] > 200  # no outliers one by one any more: the receiver itself is not believed
    assert 0.15 < 1.0 - run.health["tracking"] < 0.4


def test_the_shadow_stands_beside_and_hears_what_trust_admits() -> None:
    """It has no trust of its own: 0.32 m, coasting until the receiver is believed again.

    A Kalman filter draws no numbers, so another seed moves this by a millimetre.
    """
    run = run_of(JAM, 2)
    assert run.shadow.score.rmse_m is not None
    assert run.shadow.score.rmse_m <= 0.4
    assert run.shadow.failure == ""
    used, refused = next(counts for name, counts in run.sensors.items() if name.startswith("position"))
    heard = run.shadow.accepted["position/autopilot"] + run.shadow.gated["position/autopilot"]
    assert refused["distrusted"] > 200
    assert abs(heard - used - refused["outlier"]) <= 10  # the shadow begins a few readings later


@pytest.fixture
def beginning(tmp_path: Path) -> Path:
    """The first 700 kB of the jammed drive, cut in the middle of a frame, with its place beside it."""
    log = tmp_path / "sitl_jam.tlog"
    log.write_bytes(JAM.read_bytes()[:700_000])
    log.with_suffix(".toml").write_bytes(JAM.with_suffix(".toml").read_bytes())
    return log


def test_one_seed_gives_the_same_bytes_every_time_and_another_seed_others(
    beginning: Path, tmp_path: Path
) -> None:
    for folder, seed in (("a", 7), ("b", 7), ("c", 8)):
        run_of(beginning, seed, tmp_path / folder)
    first = (tmp_path / "a" / "estimates_seed7.csv").read_bytes()
    assert len(first) > 500_000
    assert first == (tmp_path / "b" / "estimates_seed7.csv").read_bytes()
    assert first != (tmp_path / "c" / "estimates_seed8.csv").read_bytes()
    with (tmp_path / "a" / "estimates_seed7.csv").open(newline="") as file:
        states = {row["health"] for row in csv.DictReader(file)}
    assert "tracking" in states


@pytest.mark.parametrize("log", [ROVER, JAM], ids=lambda log: log.stem)
def test_the_copies_are_small_and_whole(log: Path) -> None:
    assert log.stat().st_size <= MOST_BYTES
    data = log.read_bytes()
    kinds = [kind for kind, _ in entries(data)]
    assert sum(len(entry) for _, entry in entries(data)) == len(data)
    assert {"HIGHRES_IMU", "WHEEL_DISTANCE", "GPS_RAW_INT", "SIM_STATE"} <= set(kinds)
    stamps = [int.from_bytes(entry[:8], "big") for _, entry in entries(data)]
    assert stamps == sorted(stamps)
