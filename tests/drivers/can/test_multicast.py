"""Multicast buses, each in a network namespace of its own, which multicast cannot leave."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from drivers.can import CanLink, CanSettings
from drivers.link import LinkError

ROOT = Path(__file__).parents[3]
NAMESPACE = ["unshare", "--net"] if os.geteuid() == 0 else ["unshare", "--map-root-user", "--net"]
WITH_MULTICAST = 'ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo && exec "$@"'


def why_not() -> str:
    """The reason why no namespace can be made here, or nothing."""
    if shutil.which("unshare") is None or shutil.which("ip") is None:
        return "unshare and ip are not installed"
    tried = subprocess.run(
        [*NAMESPACE, "sh", "-c", WITH_MULTICAST, "sh", "true"], capture_output=True, text=True, check=False
    )
    return "" if tried.returncode == 0 else f"no network namespace may be made here: {tried.stderr.strip()}"


@pytest.fixture(scope="module")
def namespace() -> list[str]:
    reason = why_not()
    if reason:
        pytest.skip(reason)
    return [*NAMESPACE, "sh", "-c", WITH_MULTICAST, "sh"]


def session(command: list[str], interface: str) -> dict[str, Any]:
    done = subprocess.run(
        [*command, sys.executable, "-m", "tests.drivers.can.multicast_session", interface],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_the_bus_of_ardupilots_simulator(namespace: list[str]) -> None:
    result = session(namespace, "mcast")
    assert result["kinds"] == ["GeodeticPosition", "Velocity"]
    assert result["children"] == 0  # closed, the receiving process is gone
    assert "the receiving process has ended" in result["lost"]
    assert result["orphan_ended"]


def test_python_cans_own_multicast(namespace: list[str]) -> None:
    pytest.importorskip("msgpack", reason="python-can's udp_multicast needs msgpack")
    assert session(namespace, "udp_multicast")["kinds"] == ["GeodeticPosition", "Velocity"]


def test_without_a_route_the_link_says_so() -> None:
    reason = why_not()
    if reason:
        pytest.skip(reason)
    program = (
        "from drivers.can import CanLink, CanSettings\n"
        "link = CanLink('bus', CanSettings(interface='mcast', channel='0'))\n"
        "link.open()\n"
        "for _ in range(50): link.poll(0.1)\n"
    )
    done = subprocess.run(
        [*NAMESPACE, sys.executable, "-c", program],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert "ip route add 224.0.0.0/4 dev lo" in done.stderr
    assert "drivers.link.LinkError: bus: mcast 0 broke" in done.stderr


@pytest.mark.parametrize("channel", ["", "-1", "256", "0x1", "239.65.82.0"])
def test_a_bus_number_that_is_none(channel: str) -> None:
    with pytest.raises(LinkError, match="mcast needs the number of the bus, 0 to 255"):
        CanLink("bus", CanSettings(interface="mcast", channel=channel)).open()
