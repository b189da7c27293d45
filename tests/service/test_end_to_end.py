"""The daemon between two strangers: a plain pymavlink script and a plain Zenoh subscriber."""

from __future__ import annotations

import json
import os
import queue
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import zenoh

SCRIPTS = Path(__file__).parent / "standins"
ROOT = Path(__file__).parents[2]
PATIENCE = 90.0
"""Seconds: the first start on a machine compiles the kernels."""

CONFIGURATION = """
[vehicle]
name = "rover"
[start]
position = [0.0, 0.0, 0.0]
heading = 0.0
[loop]
rate = 50.0
{links}
[[sensor]]
kind = "range"
sigma = 0.3
[[beacon]]
id = 0
position = [20.0, 10.0, 0.0]
[[beacon]]
id = 1
position = [-5.0, 20.0, 0.0]
[publish]
zenoh = "{zenoh}"
[state]
directory = "{folder}"
"""
LINK = """
[[link]]
name = "{name}"
kind = "mavlink"
url = "udpin:127.0.0.1:{port}"
"""


def free_port(kind: socket.SocketKind) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Arrival(NamedTuple):
    """One value as the subscriber saw it."""

    seconds: float
    topic: str
    value: Any


class Vehicle:
    """A configuration of the test's own, and the processes around it."""

    def __init__(self, folder: Path, **ports: int) -> None:
        self.ports = ports
        self.endpoint = f"tcp/127.0.0.1:{free_port(socket.SOCK_STREAM)}"
        self.folder = folder
        (folder / "zenoh.json5").write_text(
            json.dumps(
                {
                    "mode": "peer",
                    "listen": {"endpoints": [self.endpoint]},
                    "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
                }
            )
        )
        self.file = folder / "rover.toml"
        links = "".join(LINK.format(name=name, port=port) for name, port in ports.items())
        self.file.write_text(CONFIGURATION.format(links=links, zenoh=folder / "zenoh.json5", folder=folder))
        self.processes: list[subprocess.Popen[str]] = []
        self.arrivals: queue.Queue[Arrival] = queue.Queue()

    def start(self, *command: str, output: int | None = None) -> subprocess.Popen[str]:
        process = subprocess.Popen(command, stdout=output, text=True, cwd=ROOT)
        self.processes.append(process)
        return process

    def start_daemon(self) -> subprocess.Popen[str]:
        return self.start(sys.executable, "-c", "from service.cli import main; main()", "run", str(self.file))

    def subscribe(self, expression: str = "beliefd/v1/rover/**") -> None:
        process = self.start(
            sys.executable,
            str(SCRIPTS / "subscriber.py"),
            self.endpoint,
            expression,
            output=subprocess.PIPE,
        )
        assert process.stdout is not None
        assert process.stdout.readline() == "subscribed\n"
        threading.Thread(target=self._read, args=(process.stdout,), daemon=True).start()

    def ask(self, query: str, payload: str) -> Any:
        """Send a query and return what is answered."""
        configuration = zenoh.Config.from_json5(
            json.dumps({"mode": "client", "connect": {"endpoints": [self.endpoint]}})
        )
        with zenoh.open(configuration) as session:
            (reply,) = session.get(f"beliefd/v1/rover/{query}", payload=payload, timeout=10.0)
            assert reply.ok is not None, reply.err and reply.err.payload.to_string()
            return json.loads(reply.ok.payload.to_string())

    def _read(self, lines: Iterator[str]) -> None:
        for line in lines:
            seconds, key, payload = line.rstrip("\n").split("\t", 2)
            topic = key.removeprefix("beliefd/v1/rover/")
            self.arrivals.put(Arrival(float(seconds), topic, json.loads(payload)))

    def drive(self, link: str, seconds: float = 30.0) -> float:
        """Start the autopilot; return the monotonic time of its first data."""
        process = self.start(
            sys.executable,
            str(SCRIPTS / "autopilot.py"),
            f"127.0.0.1:{self.ports[link]}",
            str(seconds),
            output=subprocess.PIPE,
        )
        assert process.stdout is not None
        return float(process.stdout.readline())

    def wait(self, topic: str, condition: Callable[[Any], bool]) -> Arrival:
        until = time.monotonic() + PATIENCE
        seen: Any = None
        while (left := until - time.monotonic()) > 0:
            try:
                arrival = self.arrivals.get(timeout=left)
            except queue.Empty:
                break
            if arrival.topic == topic:
                seen = arrival.value
                if condition(seen):
                    return arrival
        pytest.fail(f"no such {topic} within {PATIENCE} s; the last one: {seen}")

    def close(self) -> None:
        for process in reversed(self.processes):
            process.send_signal(signal.SIGTERM)
        for process in self.processes:
            process.wait(10.0)
            if process.stdout is not None:
                process.stdout.close()


@pytest.fixture
def vehicle(tmp_path: Path) -> Iterator[Vehicle]:
    made = Vehicle(tmp_path, autopilot=free_port(socket.SOCK_DGRAM), radio=free_port(socket.SOCK_DGRAM))
    yield made
    made.close()


def test_bytes_in_belief_out(vehicle: Vehicle, capsys: pytest.CaptureFixture[str]) -> None:
    """Issue 2, done when 4: an estimate within 2 s of the first data; 10 s are granted to a busy machine."""
    daemon = vehicle.start_daemon()
    vehicle.subscribe()
    waiting = vehicle.wait("estimate", lambda _: True).value
    assert waiting["health"] == "waiting"
    assert waiting["position"] == [None, None, None]
    first_data = vehicle.drive("autopilot")
    arrival = vehicle.wait("estimate", lambda value: value["position"][0] is not None)
    with capsys.disabled():
        sys.stdout.write(f"\nfirst data to first estimate: {arrival.seconds - first_data:.3f} s\n")
    assert arrival.seconds - first_data < 10.0
    later = vehicle.wait("estimate", lambda value: value["monotonic_ns"] * 1e-9 > first_data + 5.0)
    north, east, _ = later.value["position"]
    driven = later.value["monotonic_ns"] * 1e-9 - first_data
    assert north == pytest.approx(driven, abs=1.0)
    assert east == pytest.approx(0.0, abs=1.0)
    sensors = vehicle.wait("sensors", lambda value: bool(value["sensors"])).value
    assert {link["name"]: link["state"] for link in sensors["links"]} == {
        "autopilot": "up",
        "radio": "silent",
    }
    budget = vehicle.wait("budget", lambda value: value["particles"] > 0).value
    assert budget["stages"]["tick"]["median"] > 0.0
    assert budget["drops"]["link autopilot"] == 0
    began = time.monotonic()
    daemon.send_signal(signal.SIGTERM)
    daemon.wait(10.0)
    assert daemon.returncode == 0
    assert time.monotonic() - began < 4.0


def test_a_taken_port_is_named_and_the_rest_goes_on(vehicle: Vehicle) -> None:
    """One link's port is somebody else's: it says so and retries; the other link moves the estimate."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as squatter:
        squatter.bind(("127.0.0.1", vehicle.ports["radio"]))
        vehicle.start_daemon()
        vehicle.subscribe()
        vehicle.drive("autopilot")
        vehicle.wait("estimate", lambda value: value["position"][0] is not None)
        sensors = vehicle.wait(
            "sensors", lambda value: any(link["state"] == "retrying" for link in value["links"])
        ).value
        radio = next(link for link in sensors["links"] if link["name"] == "radio")
        assert str(vehicle.ports["radio"]) in radio["reason"]
    vehicle.wait("sensors", lambda value: all(link["state"] in ("up", "silent") for link in value["links"]))


def children(pid: int) -> dict[str, int]:
    """Return the processes under the supervisor: role to number."""
    found: dict[str, int] = {}
    for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
        words = Path(f"/proc/{child}/cmdline").read_text().split("\0")
        if "service.process" in words:
            role = words[words.index("service.process") + 1]
            name = words[words.index("--name") + 1] if "--name" in words else ""
            found[f"{role} {name}".strip()] = int(child)
    return found


def test_a_kill_in_flight_is_survived_by_all(vehicle: Vehicle) -> None:
    """Loop, link and publisher are killed in turn while the vehicle drives: the estimate comes back."""
    daemon = vehicle.start_daemon()
    vehicle.subscribe()
    vehicle.drive("autopilot", seconds=120.0)
    vehicle.wait("estimate", lambda value: value["position"][0] is not None)
    before = children(daemon.pid)
    assert set(before) == {"loop", "publisher", "keeper", "link autopilot", "link radio"}
    for role in ("link autopilot", "loop"):
        os.kill(before[role], signal.SIGKILL)
        killed = time.monotonic()
        vehicle.wait(
            "estimate",
            lambda value, killed=killed: (
                value["monotonic_ns"] * 1e-9 > killed + 1.0 and value["position"][0] is not None
            ),
        )
        vehicle.wait("sensors", lambda value: value["links"][0]["state"] == "up")
    after = children(daemon.pid)
    assert {role for role in after if after[role] != before[role]} == {"link autopilot", "loop"}
    os.kill(after["publisher"], signal.SIGKILL)
    killed = time.monotonic()
    vehicle.wait("estimate", lambda value: value["monotonic_ns"] * 1e-9 > killed + 1.0)


def test_a_loop_that_was_killed_goes_on_from_its_checkpoint(
    vehicle: Vehicle, capsys: pytest.CaptureFixture[str]
) -> None:
    """Told to begin 50 m north, driven, killed: the next loop goes on there, wider, and not where [start] says.

    3 s are asked for; 20 are granted to a busy machine.
    """
    daemon = vehicle.start_daemon()
    vehicle.subscribe()
    vehicle.wait("estimate", lambda _: True)
    asked = json.dumps({"position": [50.0, 0.0, 0.0], "heading": 0.0})
    vehicle.ask("@rpc/reinitialize", asked)
    told = vehicle.wait("estimate", lambda value: value["reset_counter"] == 1).value
    assert told["position"][0] == pytest.approx(50.0, abs=2.0)
    checkpoint = vehicle.folder / "rover.checkpoint"
    until = time.monotonic() + PATIENCE
    while not checkpoint.exists():
        assert time.monotonic() < until, "no checkpoint"
        time.sleep(0.05)
    before = vehicle.wait("estimate", lambda _: True).value
    loop = children(daemon.pid)["loop"]
    os.kill(loop, signal.SIGKILL)
    killed = time.monotonic()
    back = vehicle.wait(
        "estimate", lambda value: value["sequence"] < before["sequence"] and value["position"][0] is not None
    )
    with capsys.disabled():
        sys.stdout.write(f"\nkilled to the first estimate: {back.seconds - killed:.3f} s\n")
    assert back.seconds - killed < 20.0
    assert back.value["position"][0] == pytest.approx(50.0, abs=15.0)
    assert back.value["radius95"] > before["radius95"] + 1.0
    assert back.value["reset_counter"] == 1
