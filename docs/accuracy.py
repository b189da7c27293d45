"""Measure every recording that is there and write the table of accuracy.md: ``make accuracy`` (``SEEDS=20``).

A row is one command, run as a user would; where its recording is absent, the row that stands in the page is kept.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import measuring
from measuring import ROOT

DATA = Path("../shared/data")
OUT = Path("out/accuracy")
TABLE = ("<!-- measured: begin -->", "<!-- measured: end -->")
HEAD = (
    "recording",
    "RMSE, m",
    "worst, m",
    "inside 95 %",
    "NEES",
    "EKF: RMSE, m",
    "EKF: inside 95 %",
    "end of the blanking",
    "tracking",
    "alarms",
    "speed",
    "command",
)


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Attributes
    ----------
    needs : tuple[Path, ...]
        Files without which it cannot be measured.
    command : tuple[str, ...]
        What follows ``beliefd``.
    prepare : callable
        Makes what the command reads, before it.
    """

    name: str
    needs: tuple[Path, ...]
    command: tuple[str, ...]
    prepare: Callable[[], None] = lambda: None


def loaded(name: str) -> Any:
    """Return a module of ``tests/sitl``: what makes files of recordings lies there."""
    spec = spec_from_file_location(name, ROOT / "tests" / "sitl" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def folder() -> Path:
    """Return the folder for what the rows' commands read."""
    path = ROOT / OUT
    path.mkdir(parents=True, exist_ok=True)
    return path


def recorded(name: str) -> Path:
    """Return the path of a recording."""
    return (ROOT / DATA / name).resolve()


def prepare_car() -> None:
    """Write the car's receiver, its truth and its configuration."""
    car, recording = loaded("car"), recorded("comma2k19_seg40.candump.gz")
    car.configuration(folder(), recording)
    car.truth(folder(), recording)
    car.gnss(folder(), recording)


def prepare_field() -> None:
    """Write the mower's field without its start, and the second half of its truth."""
    references = loaded("references")
    references.without_start(folder(), recorded("plaza2.toml"))
    references.half(folder(), recorded("plaza2_truth.csv"))


def prepare_copter() -> None:
    """Write what EKF3 made of the copter among beacons, settled."""
    loaded("references").ekf3(folder(), recorded("bcn_katwijk1.bin"), SETTLED)


def prepare_telemetry() -> None:
    """Write the copter's fixes as a truth."""
    loaded("references").fixes(folder(), recorded("ubc_mission1.tlog"))


def prepare_delay() -> None:
    """Write the rover's facts with sensors that do not know the receiver's delay."""
    facts = recorded("sitl_rover.toml").read_text(encoding="utf-8")
    (folder() / "rover_delay.toml").write_text(facts + UNKNOWN_DELAY, encoding="utf-8")


def prepare_robot() -> None:
    """Make recordings of the robot among landmarks, with its bar codes' names and without."""
    script = ROOT / "examples" / "mrclam.py"
    run = ROOT / DATA / "mrclam_D7_R1.npz"
    subprocess.run([sys.executable, str(script), str(run), str(folder())], check=True, capture_output=True)


def replayed(stem: str, ending: str = ".tlog") -> Row:
    """Return the row of a recording with its facts beside it."""
    log = DATA / (stem + ending)
    return Row(stem, (log,), ("replay", str(log)))


CAR = DATA / "comma2k19_seg40.candump.gz"
CAR_FILES = (str(CAR), f"{OUT}/gnss.tlog", "--config", f"{OUT}/car.toml", "--truth", f"{OUT}/truth.csv")
COPTER = DATA / "bcn_katwijk1.bin"
SETTLED = 30.0
"""Seconds after EKF3's first word from which the copter is compared with it."""

TELEMETRY = DATA / "ubc_mission1.tlog"
TELEMETRY_FILES = (
    *(str(TELEMETRY), "--config", f"{OUT}/ubc_mission1.toml"),
    *("--truth", f"{OUT}/ubc_mission1_gnss.csv"),
)
UNKNOWN_DELAY = """
[motion]
yaw_rate_delay_ms = 56.0          # what a rover's 4 Hz filter of the gyro takes
[[sensor]]
kind = "position"
estimate = ["delay"]
[[sensor]]
kind = "velocity"
estimate = ["delay"]
"""
ROBOT = DATA / "mrclam_D7_R1.npz"
SITL = Path("tests/sitl/data")
ROWS = (
    Row("scenario `beacons`", (), ("scenario", "beacons")),
    replayed("plaza2"),
    *(replayed(f"uwb_{way}") for way in ("los_a1", "los_b3", "nlos_a1", "nlos_b3")),
    Row(
        "plaza2, from anywhere, second half",
        (DATA / "plaza2.tlog",),
        (
            *("replay", str(DATA / "plaza2.tlog"), "--config", f"{OUT}/plaza2_field.toml"),
            *("--truth", f"{OUT}/plaza2_truth_second_half.csv"),
        ),
        prepare_field,
    ),
    Row(
        "`comma2k19_seg40`, GNSS blanked from 20 to 50 s",
        (CAR,),
        ("replay", *CAR_FILES, "--blank", "position:20-50"),
        prepare_car,
    ),
    Row("mrclam_D7_R1, landmarks known", (ROBOT,), ("replay", f"{OUT}/mrclam_D7_R1.mcap"), prepare_robot),
    Row("mrclam_D7_R1, unknown", (ROBOT,), ("replay", f"{OUT}/mrclam_D7_R1_unknown.mcap"), prepare_robot),
    Row(
        "bcn_katwijk1, against EKF3",
        (COPTER, COPTER.with_suffix(".npz")),
        ("replay", str(COPTER), "--truth", f"{OUT}/ekf3.csv"),
        prepare_copter,
    ),
    Row("ubc_mission1, against its fixes", (TELEMETRY,), ("replay", *TELEMETRY_FILES), prepare_telemetry),
    Row(
        "ubc_mission1, against its fixes, blanked from 400 to 460 s",
        (TELEMETRY,),
        ("replay", *TELEMETRY_FILES, "--blank", "GPS_RAW_INT:400-460"),
        prepare_telemetry,
    ),
    replayed("sitl_rover"),
    Row(
        "sitl_rover, delay unknown",
        (DATA / "sitl_rover.tlog",),
        (
            *("replay", str(DATA / "sitl_rover.tlog"), "--config", f"{OUT}/rover_delay.toml"),
            *("--truth", str(DATA / "sitl_rover_truth.csv")),
        ),
        prepare_delay,
    ),
    replayed("sitl_jam"),
    *(
        Row(f"{stem}, trimmed", (SITL / f"{stem}.tlog",), ("replay", str(SITL / f"{stem}.tlog")))
        for stem in ("sitl_rover", "sitl_jam")
    ),
)


def spread(summary: dict[str, Any], name: str, form: str, statistic: str | None = None) -> str:
    """Return mean and standard deviation, or one statistic, of a figure; a dash where there is none."""
    if name not in summary:
        return "–"
    values = summary[name]
    if statistic is not None:
        return form.format(values[statistic])
    mean = form.format(values["mean"])
    return mean if summary.get("seeds") == 1 else f"{mean} ± {form.format(values['sd'])}"


def ended(summary: dict[str, Any]) -> str:
    """Return how far off the end of the first blanking was, of how long a way, and the Kalman filter's there."""
    if not summary["outages"]:
        return "–"
    outage = summary["outages"][0] | {"seeds": summary["seeds"]}
    said = f"{spread(outage, 'error_m', '{:.1f}')} m"
    if "share" in outage:
        said += f", {spread(outage, 'share', '{:.2%}')} of {outage['distance_m']['mean']:.0f} m"
    said += f"; 95 % within {spread(outage, 'radius_m', '{:.0f}', 'mean')} m"
    if summary["shadow_outages"]:
        said += f"; EKF {summary['shadow_outages'][0]['error_m']['mean']:.1f} m"
    return said


def alarms(runs: list[dict[str, Any]]) -> str:
    """Return how often, in all runs together, a sensor was flagged or the estimate jumped, and how long it was lost."""
    flags, resets = sum(len(run["flags"]) for run in runs), sum(run["resets"] for run in runs)
    lost = sum(run["health_seconds"].get("lost", 0.0) for run in runs)
    counts = ((flags, f"{flags} flags"), (resets, f"{resets} jumps"), (lost, f"lost {lost:.1f} s"))
    return ", ".join(said for count, said in counts if count) or "none"


def measured(row: Row, seeds: int) -> str:
    """Run a row's command, keep what it counted for the calibration, and return its line."""
    row.prepare()
    command = [*row.command, "--seeds", str(seeds)]
    said = measuring.told(command)
    shown = f"`beliefd {' '.join(command)}`"
    if isinstance(said, str):
        return f"| {row.name} | {' | '.join('–' * (len(HEAD) - 2))} | {shown}: {said[-120:]} |"
    if row.command[0] == "replay":
        measuring.keep("recordings", row.name, said, command)
    summary = said["summary"]
    shadow = summary["shadow"] | {"seeds": seeds}
    cells = (
        row.name,
        spread(summary, "rmse_m", "{:.3f}"),
        spread(summary, "max_m", "{:.2f}", "max"),
        spread(summary, "coverage_95", "{:.1%}"),
        spread(summary, "nees_mean", "{:.2f}"),
        spread(shadow, "rmse_m", "{:.3f}", "mean"),
        spread(shadow, "coverage_95", "{:.1%}", "mean"),
        ended(summary),
        f"{summary['health'].get('tracking', 0.0):.1%}, after {spread(summary, 'tracked_after_s', '{:.0f}', 'mean')} s",
        alarms(said["runs"]),
        "x" + spread(summary, "real_time_factor", "{:.0f}", "min"),
        shown,
    )
    return f"| {' | '.join(cells)} |"


def write(name: str, line: str) -> None:
    """Put one line into the page; the others stay as they stand."""
    with measuring.alone():
        rows = [row for row in measuring.standing(TABLE).splitlines() if row.startswith("|")]
        lines = {row.split("|")[1].strip(): row for row in rows} | {name: line}
        head = f"| {' | '.join(HEAD)} |\n|{'---|' * len(HEAD)}"
        measuring.put(TABLE, "\n".join([head, *(lines[row.name] for row in ROWS if row.name in lines)]))


def main() -> None:
    """Run as a program."""
    parser = argparse.ArgumentParser(description="Write the table of docs/accuracy.md.")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--only", default="", help="rows whose name holds this")
    options = parser.parse_args()
    for row in ROWS:
        if options.only in row.name and all((ROOT / path).is_file() for path in row.needs):
            print(row.name, flush=True)
            write(row.name, measured(row, options.seeds))


if __name__ == "__main__":
    main()
