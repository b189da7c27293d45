"""A copter among ranging beacons by its own DataFlash log, without a given start, against its EKF3."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from service.config import site
from service.replay import Plan, replay
from service.replay.site import setting_of
from service.score import read_truth

pytestmark = [pytest.mark.recordings, pytest.mark.slow]

BEACONS = ((0.35, -0.92), (3.81, 5.05), (-10.3, 5.22), (-6.84, 11.21))
"""Metres north and east of the origin, as the autopilot's filter has them (XKF0 in the log)."""

PLACE = """
[origin]
latitude = 52.17128
longitude = 4.4104276
[area]
north = [-15.0, 10.0]
east = [-5.0, 20.0]
[start]
mode = "global"
[motion]                          # nothing says how it moves: a walk at random
speed_noise = 1.0
yaw_rate_noise = 1.0
"""


def place(folder: Path) -> Path:
    path = folder / "place.toml"
    beacons = (f"[[beacon]]\nid = {i}\nposition = [{n}, {e}, 0.0]\n" for i, (n, e) in enumerate(BEACONS))
    path.write_text(PLACE + "".join(beacons))
    assert len(site(path).beacon) == 4
    return path


def reference(folder: Path, recording: Path) -> Path:
    """Write what EKF3 made of it as a truth file, on the clock of the log."""
    rows = np.load(recording.with_suffix(".npz"))["XKF1"]
    columns = np.column_stack([rows[:, 0], rows[:, 7:10], np.radians(rows[:, 3])])
    path = folder / "ekf3.csv"
    head = "time_s,north_m,east_m,down_m,heading_rad"
    np.savetxt(path, columns, "%.6f", delimiter=",", header=head, comments="")
    return path


@pytest.mark.parametrize("recording", ["bcn_katwijk1.bin"], indirect=True)
def test_ranges_alone_find_a_copter(recording: Path, tmp_path: Path) -> None:
    """Ranges, no odometry, anywhere in 25 by 25 m: within half a metre of EKF3 rms, and nothing is malformed."""
    setting = setting_of((recording,), place(tmp_path), None)
    truth = read_truth(reference(tmp_path, recording))
    run = replay(Plan((recording,), setting.configuration, 2000, truth), seed=0)
    assert run.links[0].malformed == {}
    assert run.links[0].samples == 25_133
    assert run.score.rmse_m is not None
    assert run.score.rmse_m <= 0.5
    assert run.health.get("tracking", 0.0) > 0.95
