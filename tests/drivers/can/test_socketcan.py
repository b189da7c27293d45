"""The kernel's own CAN sockets, where it has them: filters, time stamps, an interface that goes away."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

NAMESPACE = ["unshare", "--net"] if os.geteuid() == 0 else ["unshare", "--map-root-user", "--net"]
WITH_VCAN = 'ip link add dev vcan0 type vcan && ip link set vcan0 up && exec "$@"'
COMMAND = [*NAMESPACE, "sh", "-c", WITH_VCAN, "sh"]


def test_a_bus_of_the_kernel() -> None:
    if shutil.which("unshare") is None or shutil.which("ip") is None:
        pytest.skip("unshare and ip are not installed")
    tried = subprocess.run([*COMMAND, "true"], capture_output=True, text=True, check=False)
    if tried.returncode != 0:
        pytest.skip(f"no vcan can be made here: {tried.stderr.strip()}")
    done = subprocess.run(
        [*COMMAND, sys.executable, "-m", "tests.drivers.can.socketcan_session"],
        cwd=Path(__file__).parents[3],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["kinds"] == ["GeodeticPosition", "Velocity"]
    assert result["ignored"] == 0  # the kernel kept the unwanted frames out
    assert result["off_by_ms"] < 100.0
    assert "bring it up with ip link set vcan0 up" in result["down"]
    assert "cannot open socketcan vcan0" in result["still_down"]
    assert "bring it up with ip link set vcan0 up" in result["still_down"]
    assert "broke" in result["gone"]
    assert "cannot open socketcan vcan0" in result["absent"]
    assert "no such interface" in result["absent"]
