"""Replay of simulated bytes: cut into ticks, reproducible, told honestly, and forgiving of damage."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from pathlib import Path

import pytest

from drivers.sample import Odometer, Sample
from service.decisions import Decided
from service.estimator import Cause, Level
from service.replay import Plan, Run, replay
from service.replay.command import command
from service.replay.rows import HEADER
from service.replay.run import ticks_of
from service.replay.seeds import replay_seeds, summary
from service.replay.site import setting_of
from service.replay.sources import LogError, merged, open_log
from service.score import read_truth

SECOND = 1_000_000_000


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Half a minute of the scenario ``demo``: telemetry, CAN frames, truth, configuration."""
    stem = tmp_path_factory.mktemp("drive") / "demo"
    subprocess.run(
        [sys.executable, "-m", "sim_vehicle", "demo", "--seed", "4", "--seconds", "30", "--write", str(stem)],
        check=True,
        capture_output=True,
    )
    return stem


def logs_of(stem: Path) -> tuple[Path, ...]:
    return (stem.with_name("demo.tlog"), stem.with_name("demo.candump.log"))


def run_of(stem: Path, seed: int = 0, out: Path | None = None) -> Run:
    setting = setting_of(logs_of(stem), None, None)
    assert setting.truth is not None
    return replay(Plan(logs_of(stem), setting.configuration, 2000, read_truth(setting.truth), out), seed)


def at(milliseconds: int) -> Sample:
    time = milliseconds * 1_000_000
    return Sample(time, time, "l", "S", Odometer((0.0,)))


def test_ticks_see_what_had_been_received_and_none_is_left_out() -> None:
    samples = [at(ms) for ms in (0, 10, 15, 20, 45, 61)]
    ticks = list(ticks_of(iter(samples), 50.0))
    assert [time // 1_000_000 for time, _ in ticks] == [0, 20, 40, 60, 80]
    assert [[s.time // 1_000_000 for s in batch] for _, batch in ticks] == [[0], [10, 15, 20], [], [45], [61]]


def test_ticks_do_not_drift_at_a_rate_that_nanoseconds_cannot_hold() -> None:
    ticks = [time for time, _ in ticks_of(iter([at(k * 100_000) for k in range(37)]), 30.0)]
    assert len(ticks) == 30 * 3600 + 1
    assert ticks[-1] == 3600 * SECOND


def test_a_log_spliced_from_two_days_does_not_tick_through_the_night() -> None:
    ticks = list(ticks_of(iter([at(0), at(20), at(86_400_000)]), 50.0))
    assert len(ticks) < 5


def test_both_links_are_fused_and_the_truth_is_followed(drive: Path) -> None:
    run = run_of(drive)
    assert run.score.rmse_m is not None
    assert run.score.rmse_m < 0.5
    assert {name.split("/")[1] for name in run.sensors} == {"autopilot", "bus"}
    assert all(accepted > 0 for accepted, _ in run.sensors.values())
    assert sum(run.health.values()) == pytest.approx(1.0, abs=1e-3)


def test_one_row_a_tick_with_the_promised_columns_and_the_same_bytes_again(
    drive: Path, tmp_path: Path
) -> None:
    run = run_of(drive, 3, tmp_path / "a")
    run_of(drive, 3, tmp_path / "b")
    path = tmp_path / "a" / "estimates_seed3.csv"
    assert path.read_bytes() == (tmp_path / "b" / "estimates_seed3.csv").read_bytes()
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert ",".join(rows[0]) == HEADER
    assert len(rows) == run.ticks
    assert rows[0]["health"] == "waiting"
    assert rows[0]["north_m"] == ""
    assert float(rows[-1]["radius95_m"]) > 0
    times = [float(row["time_s"]) for row in rows]
    assert times == sorted(times)


def test_a_decision_log_gives_every_tick_what_it_had(drive: Path, tmp_path: Path) -> None:
    """Ten ticks a second from the log's own clock; the count alternates, one in ten only predicts: so it comes out."""
    logs = logs_of(drive)
    setting = setting_of(logs, None, None)
    start = next(merged([open_log(path, setting.configuration) for path in logs])).received
    decisions = tuple(
        Decided(
            tick, 0, start + tick * SECOND // 10, 300 + 200 * (tick % 2),
            Level.PREDICTION_ONLY if tick % 10 == 9 else Level.FEWER_PARTICLES, Cause.BUDGET,
            0 if tick % 10 == 9 else 64, -1, 0, (),
        )
        for tick in range(200)
    )  # fmt: skip
    plan = Plan(logs, setting.configuration, 2000, None, tmp_path, decisions=decisions)
    run = replay(plan, 0)
    with (tmp_path / "estimates_seed0.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert run.ticks == len(rows) == 200
    assert [int(row["afforded"]) for row in rows] == [decision.afforded for decision in decisions]
    started = [index for index, row in enumerate(rows) if row["north_m"]]
    assert {rows[index]["level"] for index in started if index % 10 == 9} == {"5"}
    assert {rows[index]["level"] for index in started if index % 10 != 9} == {"1"}
    assert any("prediction only" in refused for _, refused in run.sensors.values())


def test_seeds_run_side_by_side_and_keep_their_order(drive: Path) -> None:
    setting = setting_of(logs_of(drive), None, None)
    assert setting.truth is not None
    plan = Plan(logs_of(drive), setting.configuration, 500, read_truth(setting.truth))
    shares: dict[int, float] = {}
    runs = replay_seeds(plan, [0, 1], lambda seed, share, _: shares.update({seed: share}), processes=2)
    assert [run.seed for run in runs] == [0, 1]
    assert shares == {0: 1.0, 1: 1.0}
    assert runs[0].score.rmse_m != runs[1].score.rmse_m
    spread = summary(runs)
    assert spread["seeds"] == 2
    assert json.dumps(spread)


def test_a_truncated_and_damaged_log_replays_around_the_damage(drive: Path, tmp_path: Path) -> None:
    data = bytearray(logs_of(drive)[0].read_bytes())
    middle = len(data) // 2
    data[middle : middle + 400] = bytes(400)
    broken = tmp_path / "demo.tlog"
    broken.write_bytes(bytes(data[: int(len(data) * 0.9) + 3]))
    (tmp_path / "demo.toml").write_bytes(drive.with_name("demo.toml").read_bytes())
    setting = setting_of((broken,), None, None)
    run = replay(Plan((broken,), setting.configuration, 500), 0)
    whole = run_of(drive)
    assert 0.85 * whole.ticks < run.ticks < whole.ticks
    assert sum(run.links[0].malformed.values()) > 0


def test_a_file_that_is_no_log_is_refused_in_words(tmp_path: Path) -> None:
    strange = tmp_path / "log.xyz"
    strange.write_text("hello")
    with pytest.raises(LogError, match="cannot tell what log this is"):
        setting_of((strange,), None, None)
    empty = tmp_path / "empty.tlog"
    empty.write_bytes(b"")
    setting = setting_of((empty,), None, None)
    with pytest.raises(LogError, match="no usable sample"):
        replay(Plan((empty,), setting.configuration, 500), 0)
    with pytest.raises(LogError, match="no such file"):
        setting_of((tmp_path / "absent.tlog",), None, None)


def test_without_a_configuration_sensors_are_found_in_the_log(drive: Path, tmp_path: Path) -> None:
    log = tmp_path / "bare.tlog"
    log.write_bytes(logs_of(drive)[0].read_bytes())
    setting = setting_of((log,), None, None)
    assert [sensor.kind for sensor in setting.configuration.sensor] == ["range"]
    assert setting.configuration.start.mode == "first_fix"
    assert any("filled in" in note for note in setting.notes)


def test_a_log_of_another_kind_than_the_links_says_so(drive: Path, tmp_path: Path) -> None:
    file = tmp_path / "can.toml"
    file.write_text(
        '[vehicle]\nname = "v"\n[[link]]\nname = "bus"\nkind = "can"\nchannel = "vcan0"\n'
        '[[sensor]]\nkind = "position"\nsigma = 1.0\n'
    )
    setting = setting_of(logs_of(drive)[:1], file, None)
    with pytest.raises(LogError, match="no link of kind mavlink"):
        replay(Plan(logs_of(drive)[:1], setting.configuration, 500), 0)


def test_the_command_prints_one_json_object(drive: Path, tmp_path: Path) -> None:
    program = [str(Path(sys.executable).with_name("beliefd")), "replay", *map(str, logs_of(drive))]
    done = subprocess.run(
        [*program, "--json", "--out", str(tmp_path)], capture_output=True, text=True, check=True
    )
    result = json.loads(done.stdout)
    run = result["runs"][0]
    assert set(run) >= {"seed", "rmse_m", "mean_m", "p95_m", "max_m", "coverage_95", "nees_mean", "final_m"}
    assert set(run) >= {"particles_mean", "late_samples", "dropped", "health", "seconds", "real_time_factor"}
    assert result["summary"]["seeds"] == 1
    assert (tmp_path / "estimates_seed0.csv").is_file()


def test_a_switch_that_is_turned_off_changes_the_run(drive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def told(*without: str) -> dict[str, object]:
        logs = list(logs_of(drive))
        status = command(logs, None, None, 1, None, None, as_json_object=True, particles=500, without=without)
        assert status == 0
        return json.loads(capsys.readouterr().out)["runs"][0]

    assert told()["log_score"] != told("noise_learning")["log_score"]


def test_a_switch_that_there_is_not_is_refused(drive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    logs = list(logs_of(drive))
    assert (
        command(logs, None, None, 1, None, None, as_json_object=False, particles=None, without=["luck"]) == 2
    )
    assert "--without luck: [honesty] has hypotheses," in capsys.readouterr().out
