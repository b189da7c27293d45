"""One run of the real daemon beside a load, and what it says of itself meanwhile."""

from __future__ import annotations

import argparse
import contextlib
import json
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
import zenoh
from traffic import BEACONS

from service.estimate import Budget, Estimate, Sensors, Status

ROOT = Path(__file__).parents[1]
TRAFFIC = Path(__file__).with_name("traffic.py")
SETTLED = 5
"""Seconds after which page faults count."""
CONFIGURATION = """
[vehicle]
name = "rover"
[start]
position = [0.0, 0.0, 0.0]
heading = 0.0
[loop]
rate = {rate}
priority = {priority}
[budget]
cpu_ms = {budget}
[[link]]
name = "autopilot"
kind = "mavlink"
url = "udpin:127.0.0.1:{port}"
[[sensor]]
kind = "range"
sigma = 0.3
{beacons}
[publish]
zenoh = "{zenoh}"
[state]
directory = "{folder}"
"""


class Outcome(NamedTuple):
    """What one run came to."""

    last: Budget
    counts: list[int]
    faults: float


def run(arguments: argparse.Namespace) -> Outcome:
    with tempfile.TemporaryDirectory(prefix="beliefd-deadline-") as folder:
        return measure(arguments, Path(folder))


@contextlib.contextmanager
def loaded(load: str, endpoint: str) -> Iterator[None]:
    """Have the load beside the daemon for as long as this lasts."""
    if load == "stress":
        others = subprocess.Popen(
            stress(), stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
    elif load == "stopped":
        others = subprocess.Popen(
            [sys.executable, "-c", SUBSCRIBER, endpoint], stdout=subprocess.PIPE, text=True
        )
        assert others.stdout is not None
        others.stdout.readline()
        others.send_signal(signal.SIGSTOP)
    else:
        yield
        return
    try:
        yield
    finally:
        others.send_signal(signal.SIGCONT)
        if others.stdin is not None:
            others.stdin.close()
        others.terminate()
        others.wait()


def stress() -> list[str]:
    """Return the command of the load: stress-ng, or where that is absent four processes that only count."""
    if shutil.which("stress-ng"):
        return ["stress-ng", "--cpu", "4", "--vm", "1", "--timeout", "0"]
    print("no stress-ng here: four processes that only count, in its place")
    return [sys.executable, "-c", SPINNERS]


SPINNERS = """
import signal, subprocess, sys
signal.signal(signal.SIGTERM, signal.SIG_IGN)
spinners = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(4)]
try:
    sys.stdin.read()
finally:
    for spinner in spinners:
        spinner.kill()
"""
SUBSCRIBER = """
import json, sys, time, zenoh
settings = zenoh.Config()
settings.insert_json5("mode", '"client"')
settings.insert_json5("connect/endpoints", json.dumps([sys.argv[1]]))
settings.insert_json5("scouting/multicast/enabled", "false")
session = zenoh.open(settings)
subscriber = session.declare_subscriber("beliefd/v1/rover/**")
subscriber.recv()
print("heard", flush=True)
while True:
    subscriber.recv()
"""


def measure(arguments: argparse.Namespace, folder: Path) -> Outcome:
    port, zenoh_port = free_port(socket.SOCK_DGRAM), free_port(socket.SOCK_STREAM)
    endpoint = f"tcp/127.0.0.1:{zenoh_port}"
    file = configure(arguments, folder, port, endpoint)
    began = time.monotonic()
    with (folder / "log").open("wb") as log:
        daemon = subprocess.Popen(
            [sys.executable, "-c", "from service.cli import main; main()", "run", str(file)],
            cwd=ROOT,
            stderr=log,
        )
    try:
        with open_client(endpoint) as session:
            return observe(arguments, session, daemon, began, port, endpoint)
    finally:
        daemon.send_signal(signal.SIGTERM)
        daemon.wait()
        print((folder / "log").read_text())


def observe(
    arguments: argparse.Namespace,
    session: Any,
    daemon: subprocess.Popen[bytes],
    began: float,
    port: int,
    endpoint: str,
) -> Outcome:
    estimates = session.declare_subscriber("beliefd/v1/rover/estimate", zenoh.handlers.RingChannel(4096))
    states = session.declare_subscriber("beliefd/v1/rover/*", zenoh.handlers.RingChannel(4096))
    first = first_estimate(estimates)
    print(f"start of the daemon to its first estimate: {first.monotonic_ns * 1e-9 - began:.2f} s")
    numbers = (port, arguments.flood, arguments.seconds)
    command = [sys.executable, str(TRAFFIC), *map(str, numbers)]
    budgets: list[Budget] = []
    links: Sensors | None = None
    heard: list[Estimate] = [first]
    with loaded(arguments.load, endpoint):
        sender = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
        while sender.poll() is None:
            heard += [msgspec.json.decode(p, type=Estimate) for _, p in drained(estimates)]
            for key, payload in drained(states):
                if key.endswith("/budget"):
                    budgets.append(msgspec.json.decode(payload, type=Budget))
                elif key.endswith("/sensors"):
                    links = msgspec.json.decode(payload, type=Sensors)
            time.sleep(0.02)
    assert sender.stdout is not None
    print("sender:", sender.stdout.read().strip())
    report(heard, budgets, links)
    over_time(budgets)
    memory(session, daemon.pid)
    settled = budgets[SETTLED:]
    ticks = settled[-1].ticks - settled[0].ticks if len(settled) > 1 else 0
    faults = 1e3 * sum(budget.page_faults for budget in settled[1:]) / max(1, ticks)
    print(f"page faults per 1,000 ticks after {SETTLED} s: {faults:.1f}")
    return Outcome(budgets[-1], [estimate.particles for estimate in heard if estimate.particles], faults)


def over_time(budgets: list[Budget]) -> None:
    """Print at most twenty lines: what was demanded, afforded and used, and what was given up."""
    print("   s  demanded afforded     used level  missed  why")
    for budget in budgets[:: max(1, len(budgets) // 20)]:
        elapsed = budget.time - budgets[0].time
        print(f"{elapsed:4.0f} {budget.demanded:9} {budget.afforded:8} {budget.particles:8} {budget.level:5} "
              f"{budget.missed_ticks:7}  {budget.level_reason}")  # fmt: skip


def report(heard: list[Estimate], budgets: list[Budget], links: Sensors | None) -> None:
    last = budgets[-1]
    lateness = np.array([budget.lateness.worst for budget in budgets])
    use = np.array([budget.use for budget in budgets])
    counts = np.array([estimate.particles for estimate in heard if estimate.particles])
    gaps = np.diff([estimate.sequence for estimate in heard])
    ages = np.diff([estimate.monotonic_ns for estimate in heard]) * 1e-6
    print(f"ticks {last.ticks}, missed {last.missed_ticks}, over the budget {last.overruns}")
    print(f"lateness, worst of each second, ms: median {np.median(lateness):.3f}, worst {lateness.max():.3f}")
    medians, p99s = ([getattr(b.lateness, name) for b in budgets] for name in ("median", "p99"))
    print(f"lateness, ms: median of medians {np.median(medians):.3f}, median of 99 % {np.median(p99s):.3f}")
    print(f"budget use: median {np.median(use):.3f}, largest second {use.max():.3f} of {last.budget_ms} ms")
    print("stages of the last second, median / 99 % / worst, ms:")
    for stage, cost in last.stages.items():
        print(f"  {stage:12} {cost.median:7.3f} {cost.p99:7.3f} {cost.worst:7.3f}")
    if len(counts):
        print(f"particles: mean {counts.mean():.0f}, most {counts.max()}; demanded {last.demanded}, "
              f"afforded {last.afforded}, level {last.level}")  # fmt: skip
    print(f"estimates received {len(heard)}, lost on the way {int((gaps - 1).sum())}; ms between them: "
          f"99 % {np.percentile(ages, 99):.2f}, worst {ages.max():.2f}")  # fmt: skip
    print("drops:", last.drops)
    for link in links.links if links else []:
        print(f"link {link.name}: {link.messages} messages, {link.samples} samples, dropped {link.dropped}, "
              f"ignored {link.ignored}, malformed {link.malformed}")  # fmt: skip


def memory(session: Any, supervisor: int) -> None:
    reply = next(iter(session.get("beliefd/v1/rover/@rpc/status", timeout=5.0)))
    status = msgspec.json.decode(reply.ok.payload.to_bytes(), type=Status)
    total = 0.0
    print("memory, MB (resident, proportional):")
    for process in status.processes:
        rolled = dict(smaps(process.pid)) if process.pid else {}
        total += rolled.get("Pss", 0.0)
        print(f"  {process.name:20} {rolled.get('Rss', 0.0):7.1f} {rolled.get('Pss', 0.0):7.1f}"
              f"   restarts {process.restarts}")  # fmt: skip
    print(f"  {'all':20} {'':7} {total:7.1f}")


def smaps(pid: int) -> Iterator[tuple[str, float]]:
    for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()[1:]:
        name, _, rest = line.partition(":")
        yield name, int(rest.split()[0]) / 1024


def drained(subscriber: Any) -> Iterator[tuple[str, bytes]]:
    while (value := subscriber.try_recv()) is not None:
        yield str(value.key_expr), value.payload.to_bytes()


def first_estimate(subscriber: Any) -> Estimate:
    until = time.monotonic() + 180.0
    while time.monotonic() < until:
        for _, payload in drained(subscriber):
            return msgspec.json.decode(payload, type=Estimate)
        time.sleep(0.002)
    raise SystemExit("no estimate within 180 s")


def open_client(endpoint: str) -> Any:
    configuration = zenoh.Config()
    configuration.insert_json5("mode", '"client"')
    configuration.insert_json5("connect/endpoints", json.dumps([endpoint]))
    configuration.insert_json5("connect/timeout_ms", "60000")
    configuration.insert_json5("connect/retry", '{"period_init_ms": 50, "period_max_ms": 100}')
    configuration.insert_json5("scouting/multicast/enabled", "false")
    return zenoh.open(configuration)


def configure(arguments: argparse.Namespace, folder: Path, port: int, endpoint: str) -> Path:
    session = {
        "mode": "peer",
        "listen": {"endpoints": [endpoint]},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {"shared_memory": {"enabled": False}},
    }
    (folder / "zenoh.json5").write_text(json.dumps(session))
    beacons = "".join(
        f"[[beacon]]\nid = {beacon}\nposition = [{north}, {east}, 0.0]\n"
        for beacon, (north, east) in BEACONS.items()
    )
    file = folder / "rover.toml"
    file.write_text(
        CONFIGURATION.format(
            rate=arguments.rate, priority=arguments.priority, budget=arguments.budget, port=port,
            beacons=beacons, zenoh=folder / "zenoh.json5", folder=folder,
        )
    )  # fmt: skip
    return file


def free_port(kind: socket.SocketKind) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
