"""From the command to the first estimate on Zenoh: ``beliefd run``, started STARTS times with all kernels compiled.

    python benchmarks/start.py [--starts 10]

Each way of starting is measured by itself: ``again`` (a configuration that ran before), ``first`` (one whose costs the
loop has to measure), ``untranslated`` (as ``again``, where Python keeps no byte code of the daemon's modules). Beside
the time on the clock stands the processor time of every process until then. Writes docs/performance.md.
"""

from __future__ import annotations

import argparse
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from statistics import mean, median
from typing import NamedTuple

import zenoh
from observation import ROOT, configure, first_estimate, free_port, open_client
from report import machine, write

from service import bytecode

NAMES = ("supervisor", "loop", "publisher", "link", "keeper")
WAYS = ("again", "first", "untranslated")
_TICK = os.sysconf("SC_CLK_TCK")


class Outcome(NamedTuple):
    """One start."""

    seconds: float
    processors: dict[str, float]
    """Seconds of processor time, by process."""


def main() -> None:
    arguments = parse()
    outcomes: dict[str, list[Outcome]] = {}
    for way in WAYS:
        if way == "untranslated":
            forget()
        else:
            bytecode.keep()
        start(way, 0)  # whatever is compiled or measured only once is done by then
        outcomes[way] = [start(way, number) for number in range(arguments.starts)]
    bytecode.keep()
    text = table(outcomes, arguments.starts)
    print(text)
    write("start", text)


def forget() -> None:
    """Remove the byte code of the daemon's own modules."""
    for package in bytecode.PACKAGES:
        for path in (ROOT / package).rglob("*.pyc"):
            path.unlink()


def start(way: str, number: int) -> Outcome:
    """Start the daemon, wait for its first estimate, and stop it."""
    budget = 4.0 + (time.time() % 1e3 * 1e-6 if way == "first" else 0.0)
    settings = argparse.Namespace(rate=100.0, priority=0, budget=budget)
    with tempfile.TemporaryDirectory(prefix="beliefd-start-") as name:
        folder = Path(name)
        endpoint = f"tcp/127.0.0.1:{free_port(socket.SOCK_STREAM)}"
        file = configure(settings, folder, free_port(socket.SOCK_DGRAM), endpoint)
        began = time.monotonic()
        with (folder / "log").open("wb") as log:
            daemon = subprocess.Popen(
                [sys.executable, "-c", "from service.cli import main; main()", "run", str(file)],
                cwd=ROOT,
                env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"},
                stderr=log,
            )
        try:
            with open_client(endpoint) as session:
                estimates = session.declare_subscriber(
                    "beliefd/v1/rover/estimate", zenoh.handlers.RingChannel(4096)
                )
                first_estimate(estimates)
                outcome = Outcome(time.monotonic() - began, processors(daemon.pid))
        finally:
            daemon.send_signal(signal.SIGTERM)
            daemon.wait()
    print(f"{way} {number}: {outcome.seconds:.2f} s", flush=True)
    return outcome


def processors(supervisor: int) -> dict[str, float]:
    """Return the processor time of the daemon's processes so far."""
    children = Path(f"/proc/{supervisor}/task/{supervisor}/children").read_text().split()
    spent = {"supervisor": processor(supervisor)}
    for child in map(int, children):
        words = Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0")
        spent[words[words.index(b"service.process") + 1].decode()] = processor(child)
    return spent


def processor(pid: int) -> float:
    numbers = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(numbers[11]) + int(numbers[12])) / _TICK


def table(outcomes: Mapping[str, list[Outcome]], starts: int) -> str:
    lines = [
        f"{starts} starts each. Processor time of each process until the first estimate is there, mean.",
        "",
        f"| start | s: median (from, to) | {' | '.join(f'{name}, s' for name in NAMES)} |",
        f"|---|---|{'---|' * len(NAMES)}",
    ]
    for way, runs in outcomes.items():
        seconds = [run.seconds for run in runs]
        spent = [mean(run.processors.get(name, 0.0) for run in runs) for name in NAMES]
        lines.append(
            f"| {way} | {median(seconds):.2f} ({min(seconds):.2f}, {max(seconds):.2f}) "
            f"| {' | '.join(f'{value:.2f}' for value in spent)} |"
        )
    return "\n".join([*lines, "", f"Machine: {machine()}. By `benchmarks/start.py` (in `make bench`)."])


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=10)
    return parser.parse_args()


if __name__ == "__main__":
    main()
