"""A copter among ranging beacons by its own DataFlash log, without a given start, against its EKF3."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from service.replay import Plan, replay
from service.replay.site import setting_of
from service.score import read_truth

pytestmark = [pytest.mark.recordings, pytest.mark.slow]


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
    """Nothing is given: beacons and motion by the log, a start about them. Within half a metre of EKF3 rms."""
    setting = setting_of((recording,), None, None)
    assert len(setting.configuration.beacon) == 4
    assert setting.configuration.start.mode == "global"
    truth = read_truth(reference(tmp_path, recording))
    run = replay(Plan((recording,), setting.configuration, 1000, truth), seed=0)
    assert run.links[0].malformed == {}
    assert run.links[0].samples == 25_137
    assert run.score.rmse_m is not None
    assert run.score.rmse_m <= 0.5
    assert run.health.get("tracking", 0.0) > 0.95
