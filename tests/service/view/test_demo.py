"""The demonstration from end to end: simulator, daemon, subscriber, verdict; and nothing left behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.service.publish.spoken import wait_for

PROGRAM = """
import sys
from pathlib import Path
from service.view.demo import run
sys.exit(run(float(sys.argv[1]), sys.argv[2], Path(sys.argv[3]) if sys.argv[3:] else None))
"""


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    """Return an environment whose temporary files, and so the demonstration's processes, can be told."""
    return {**os.environ, "TMPDIR": str(tmp_path), "COLUMNS": "100"}


def left_behind(folder: Path) -> list[str]:
    """Return the processes that have ``folder`` on their command line."""
    found: list[str] = []
    for entry in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            line = entry.read_bytes()
        except OSError:
            continue
        if str(folder).encode() in line and int(entry.parent.name) != os.getpid():
            found.append(line.replace(b"\0", b" ").decode(errors="replace"))
    return found


@pytest.mark.slow
def test_the_whole_chain_works(tmp_path: Path, environment: dict[str, str]) -> None:
    """Eight seconds of the demo scenario: both links bring samples, the error is sane, the picture drawn."""
    picture = tmp_path / "pictures" / "demo.svg"
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, "8", "demo", str(picture)],
        env=environment,
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "kernels ready" in done.stdout
    for fact in (
        " m RMSE",
        "inside radius95",
        "of 4 ms used",
        "link autopilot",
        "link bus",
        "received",
    ):
        assert fact in done.stdout, done.stdout
    assert "failed" not in done.stdout
    svg = picture.read_text()
    assert "demo-rover" in svg
    assert "http" not in svg.replace("http://www.w3.org/2000/svg", "").replace(
        "https://www.textualize.io", ""
    )
    assert [path.name for path in tmp_path.iterdir()] == ["pictures"]
    assert left_behind(tmp_path) == []


def test_an_interrupt_stops_everything(tmp_path: Path, environment: dict[str, str]) -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, "600", "demo"],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    try:
        wait_for(
            lambda: any(path.joinpath("daemon.log").exists() for path in tmp_path.glob("beliefd-demo-*")), 100
        )
        process.send_signal(signal.SIGINT)
        out, _ = process.communicate(timeout=20)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 1
    assert "interrupted; everything is stopped" in out
    assert list(tmp_path.iterdir()) == []
    assert left_behind(tmp_path) == []


def test_an_unknown_scenario_is_refused(tmp_path: Path, environment: dict[str, str]) -> None:
    refusal = subprocess.run(
        [sys.executable, "-c", PROGRAM, "8", "moon"],
        env=environment,
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    assert refusal.returncode == 2
    assert "'moon'" in refusal.stderr
    assert "beacons, demo" in refusal.stderr
    assert "kernels" not in refusal.stdout
    assert list(tmp_path.iterdir()) == []
