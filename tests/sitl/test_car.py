"""A minute of a real car by candump and DBC, with its GNSS beside it: the whole way from bytes to estimates."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from service.config import load
from service.replay import Plan, replay
from service.score import read_truth
from tests.sitl import car

pytestmark = [pytest.mark.recordings, pytest.mark.slow]


@pytest.mark.parametrize("recording", ["comma2k19_seg40.candump.gz"], indirect=True)
def test_wheels_and_yaw_rate_of_a_car_by_dbc(recording: Path, tmp_path: Path) -> None:
    """Four wheels and the yaw rate as odometry: the bias and the scale that others found, within three sigmas."""
    configuration = load(car.configuration(tmp_path, recording))
    logs = (recording, car.gnss(tmp_path, recording))
    run = replay(Plan(logs, configuration, 5000, read_truth(car.truth(tmp_path, recording))), seed=0)
    bus, receiver = run.links
    assert (bus.messages, bus.samples, bus.malformed, bus.ignored) == (9_948, 9_948, {}, 135_468 - 9_948)
    assert receiver.messages == 579
    assert run.score.rmse_m is not None
    assert run.score.rmse_m <= 2.5  # the receiver alone: 1.5, late and offset
    bias, sigma = run.biases["gyro_bias"]
    assert bias == pytest.approx(0.0070, abs=3 * sigma)
    scale, sigma = run.biases["odometry_scale"]
    assert scale == pytest.approx(1 / 0.9916, abs=3 * sigma)
    assert run.health.get("tracking", 0.0) > 0.9


@pytest.mark.parametrize("recording", ["comma2k19_seg40.candump.gz"], indirect=True)
def test_a_car_coasts_half_a_minute_without_fixes(recording: Path, tmp_path: Path) -> None:
    """Fixes blanked from 20 to 50 s, 503 m: off by less than 2 % of it at any time, and it says that it coasts."""
    configuration = load(car.configuration(tmp_path, recording))
    logs = (recording, car.gnss(tmp_path, recording, (20.0, 50.0)))
    run = replay(Plan(logs, configuration, 5000, read_truth(car.truth(tmp_path, recording))), seed=0)
    assert run.score.max_m is not None
    assert run.score.max_m <= 10.0
    assert run.health["dead_reckoning"] == pytest.approx(27 / 60, abs=0.03)


@pytest.mark.parametrize("recording", ["comma2k19_seg40.candump.gz"], indirect=True)
def test_four_speed_sensors_drive_as_well_as_the_wheels_of_one_message(
    recording: Path, tmp_path: Path
) -> None:
    """Each wheel as a speed of its own, with its lever: the bounds of an odometer, and its scale."""
    path = car.configuration(tmp_path, recording)
    text = re.sub(r'measures = "wheel_speed"\nindex = \d', 'measures = "speed"', path.read_text())
    for wheel, lever in {
        "FL": (2.7, -0.77),
        "FR": (2.7, 0.77),
        "RL": (0.0, -0.77),
        "RR": (0.0, 0.77),
    }.items():
        text += '[[sensor]]\nkind = "speed"\nlink = "bus"\nsigma = 0.05\n'
        text += f'source = "WHEEL_SPEEDS.WHEEL_SPEED_{wheel}"\nlever = {list(lever)}\n'
    path.write_text(text)
    logs = (recording, car.gnss(tmp_path, recording))
    run = replay(Plan(logs, load(path), 2000, read_truth(car.truth(tmp_path, recording))), seed=0)
    assert run.score.rmse_m is not None
    assert run.score.rmse_m <= 2.5
    scale, sigma = run.biases["odometry_scale"]
    assert scale == pytest.approx(1 / 0.9916, abs=3 * sigma)
    assert run.sensors["speed/bus/WHEEL_SPEEDS.WHEEL_SPEED_RR"][0] > 4900
