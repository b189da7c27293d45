"""Speeds and altitudes end to end: message bytes that ``sim_vehicle`` wrote, through the drivers into the estimator."""

from __future__ import annotations

import csv
import math
from dataclasses import replace
from pathlib import Path

import pytest

from service.config import Sensor
from service.replay import Plan, Run, replay
from service.replay.site import Setting, setting_of
from service.score import read_truth
from tests.sitl.test_simulated import PARTICLES, written

HALF_TRACK = 0.25
"""Metres: what the simulated rover's wheels lie beside its centre, as its drives say."""

BAROMETERS = tuple(
    Sensor(kind="altitude", link=link, sigma=0.3, outliers=0.01, estimate=("bias",))
    for link in ("autopilot", "bus")
)


def run_of(
    logs: tuple[Path, ...], setting: Setting, sensors: tuple[Sensor, ...], out: Path, **motion: str
) -> Run:
    """Replay with these sensors in place of the configuration's own."""
    assert setting.truth is not None
    configuration = setting.configuration.model_copy(
        update={"sensor": sensors, "motion": setting.configuration.motion.model_copy(update=motion)}
    )
    return replay(Plan(logs, configuration, PARTICLES, read_truth(setting.truth), out), 1)


def last_down(out: Path) -> tuple[float, float]:
    with (out / "estimates_seed1.csv").open() as file:
        row = list(csv.DictReader(file))[-1]
    return float(row["down_m"]), math.sqrt(float(row["cov_dd"]))


def test_two_wheels_by_name_drive_as_well_as_an_odometer(tmp_path: Path) -> None:
    """WHEEL_DISTANCE as two speed sensors, each with its lever: 60 s with ranges below 0.3 m, like the odometer's; both
    wheels are in the control, and none is weighed against itself."""
    logs = written(tmp_path, "beacons", 1, 60)
    setting = setting_of(logs, None, None)
    wheels = tuple(
        Sensor(kind="speed", source="WHEEL_DISTANCE", index=index, lever=(0.0, side), sigma=0.05)
        for index, side in enumerate((-HALF_TRACK, HALF_TRACK))
    )
    run = run_of(logs, setting, (*setting.configuration.sensor, *wheels), tmp_path, speed_from="sensors")
    assert run.score.rmse_m is not None
    assert run.score.rmse_m <= 0.3
    for index in range(2):
        accepted, refused = run.sensors[f"speed/autopilot/WHEEL_DISTANCE/{index}"]
        assert accepted > 1000
        assert not refused


def test_ranges_and_a_wheels_speed_hold_a_tag_better_than_ranges(tmp_path: Path) -> None:
    """The same drive as a tag's, of which no heading is known: the speed makes the error smaller, and the region still
    holds the truth. The wheels slip, so their scale is estimated, too."""
    logs = written(tmp_path, "beacons", 1, 60)
    setting = setting_of(logs, None, None)
    vehicle = setting.configuration.vehicle.model_copy(update={"motion": "constant_velocity"})
    tag = replace(setting, configuration=setting.configuration.model_copy(update={"vehicle": vehicle}))
    ranges = setting.configuration.sensor
    speed = Sensor(kind="speed", source="WHEEL_DISTANCE", sigma=0.1, estimate=("scale",))
    without, beside = (
        run_of(logs, tag, sensors, tmp_path / str(len(sensors))) for sensors in (ranges, (*ranges, speed))
    )
    assert without.score.rmse_m is not None
    assert beside.score.rmse_m is not None
    assert beside.score.rmse_m < without.score.rmse_m
    assert beside.score.coverage_95 is not None
    assert beside.score.coverage_95 >= 0.85
    assert beside.biases["speed_scale/WHEEL_DISTANCE"][0] == pytest.approx(1.0, abs=0.15)


def test_barometers_of_both_links_keep_the_height_when_gnss_is_lost(tmp_path: Path) -> None:
    """HIGHRES_IMU and SCALED_PRESSURE by MAVLink, StaticPressure by DroneCAN, each link with a weather of its own; GNSS
    is lost after 20 s of 60. The ground is flat: down lies within 3.5 standard deviations of 0, each below 0.5 m."""
    logs = written(tmp_path, "demo", 3, 60)
    setting = setting_of(logs, None, None)
    run = run_of(logs, setting, (*setting.configuration.sensor, *BAROMETERS), tmp_path)
    down, sigma = last_down(tmp_path)
    assert sigma < 0.5
    assert abs(down) < 3.5 * sigma
    for link in ("autopilot", "bus"):
        assert run.sensors[f"altitude/{link}"][0] > 300
        assert f"altitude_bias/{link}" in run.biases
