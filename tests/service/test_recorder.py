"""The recording of decisions, on a real queue and a real disk, or one that is always full."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

from drivers.logs.recording import RecordingReader
from service.channels import Outlet, pair
from service.decisions import DecisionSender, read
from service.estimator import Course
from service.recorder import Recorder, decision_log, run_recording
from service.replay.recorded import run_in


def send(sender: DecisionSender, ticks: int) -> None:
    for tick in range(ticks):
        sender.send(tick, tick, tick, 300, Course(), [1])


def test_a_loop_that_starts_anew_gets_a_new_head(tmp_path: Path) -> None:
    ends = pair(1 << 16)
    recorder = Recorder([decision_log(tmp_path / "log.csv", ["bus"])], ends.inlet)
    sender = DecisionSender(Outlet(ends.outlet), 1)
    send(sender, 5)
    send(sender, 3)
    assert recorder.step(0)
    assert not recorder.step(0)
    recorder.close()
    ends.close()
    assert len(read(tmp_path / "log.csv")) == 3
    assert (tmp_path / "log.csv").read_text().count("taken bus") == 2


def test_a_full_disk_ends_the_recording_with_one_line(caplog: pytest.LogCaptureFixture) -> None:
    """What comes afterwards is taken from the queue and thrown away: the loop never meets a full one."""
    ends = pair(1 << 20)
    recorder = Recorder([decision_log(Path("/dev/full"), ["bus"])], ends.inlet)
    sender = DecisionSender(Outlet(ends.outlet), 1)
    with caplog.at_level(logging.ERROR):
        for _ in range(5):
            send(sender, 200)
            recorder.step(0)
            recorder.close()
    assert not recorder.recording
    assert [record.getMessage() for record in caplog.records] == [
        "/dev/full: No space left on device; the recording of decisions ends here, the estimate goes on"
    ]
    assert sender.dropped == 0
    ends.close()


def test_a_folder_that_is_not_there_is_said(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    ends = pair(1 << 14)
    recorder = Recorder([decision_log(tmp_path / "none" / "log.csv", ["bus"])], ends.inlet)
    recorder.step(0)
    assert "No such file" in caplog.text
    ends.close()


def test_a_full_disk_ends_the_recording_of_a_run_with_one_line(caplog: pytest.LogCaptureFixture) -> None:
    ends = pair(1 << 20)
    recorder = Recorder([run_recording(Path("/dev/full"))], ends.inlet)
    sender = DecisionSender(Outlet(ends.outlet), 1)
    with caplog.at_level(logging.ERROR):
        for _ in range(20):
            send(sender, 200)
            recorder.step(0)
        recorder.close()
    assert not recorder.recording
    assert [record.getMessage() for record in caplog.records] == [
        "/dev/full: No space left on device; the recording ends here, the estimate goes on"
    ]
    assert sender.dropped == 0
    ends.close()


def test_one_full_file_does_not_end_the_other(tmp_path: Path) -> None:
    ends = pair(1 << 20)
    sinks = [run_recording(Path("/dev/full")), decision_log(tmp_path / "log.csv", ["bus"])]
    recorder = Recorder(sinks, ends.inlet)
    sender = DecisionSender(Outlet(ends.outlet), 1)
    for tick in range(5000):
        sender.send(tick, tick, tick, 300, Course(), [1])
        recorder.step(0)
    recorder.close()
    assert len(read(tmp_path / "log.csv")) == 5000
    ends.close()


def test_a_recorder_that_starts_anew_writes_beside_what_there_is(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    ends = pair(1 << 16)
    path = tmp_path / "drive.mcap"
    path.write_bytes(b"what the first one wrote")
    recorder = Recorder([run_recording(path)], ends.inlet)
    send(DecisionSender(Outlet(ends.outlet), 1), 3)
    recorder.step(0)
    recorder.close()
    ends.close()
    assert path.read_bytes() == b"what the first one wrote"
    entries = list(RecordingReader(tmp_path / "drive-2.mcap").entries())
    assert [entry.topic for entry in entries] == ["decision"] * 3
    assert "goes on in" in caplog.text
    assert run_in(tmp_path / "drive-2.mcap") is None
