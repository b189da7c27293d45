"""What the checks in the guest stand on: a tally with times, waiting with a bound, the unit, a subscriber.

Nothing here imports the project: what is checked is what is installed, from outside.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import zenoh

SERVICE = "beliefd.service"
PATIENCE = 120.0
"""Seconds for what starts a process or two: the guest has one processor, and its page faults and system calls cost
up to a hundred times what they cost elsewhere."""

_POLL = 0.25
_GROUP = Path("/sys/fs/cgroup/system.slice", SERVICE, "cgroup.procs")


class CheckError(AssertionError):
    """A check failed; the text says what was seen."""


class Tally:
    """Counts what passed and failed, and says when."""

    def __init__(self) -> None:
        self.passed = 0
        self.failed = 0
        self._start = time.monotonic()

    def say(self, text: str) -> None:
        """Write a line with the time since the start."""
        sys.stdout.write(f"[{time.monotonic() - self._start:6.1f}s] {text}\n")
        sys.stdout.flush()

    @contextmanager
    def check(self, name: str) -> Iterator[list[str]]:
        """Run a check, and go on whatever becomes of it; the facts it appends are said beside its name."""
        began = time.monotonic()
        facts: list[str] = []
        try:
            yield facts
        except Exception as error:  # noqa: BLE001 - whatever goes wrong in a check is its failure
            self.failed += 1
            where = traceback.extract_tb(error.__traceback__)[-1]
            self.say(f"FAIL {name}: {type(error).__name__}: {error} (line {where.lineno})")
        else:
            self.passed += 1
            told = f": {', '.join(facts)}" if facts else ""
            self.say(f"ok   {name} ({time.monotonic() - began:.1f} s){told}")

    def summary(self) -> int:
        """Print the count; return the exit status."""
        self.say(f"{self.passed} passed, {self.failed} failed")
        return 1 if self.failed or not self.passed else 0


def run(*command: str, timeout: float = PATIENCE) -> subprocess.CompletedProcess[str]:
    """Run a program to its end; its status is the caller's to judge."""
    return subprocess.run(command, capture_output=True, text=True, timeout=timeout, check=False)


def must(*command: str, timeout: float = PATIENCE) -> str:
    """Run a program that has to succeed; return what it printed."""
    done = run(*command, timeout=timeout)
    if done.returncode != 0:
        raise CheckError(f"{' '.join(command)}: exit {done.returncode}: {done.stdout}{done.stderr}")
    return done.stdout


def expect(condition: object, seen: object) -> None:
    """Fail the check with what was seen unless the condition holds."""
    if not condition:
        raise CheckError(str(seen))


def until(condition: Callable[[], Any], what: str, seconds: float = PATIENCE) -> Any:
    """Wait for a condition and return its value; fail when it does not come in time."""
    end = time.monotonic() + seconds
    while True:
        value = condition()
        if value:
            return value
        if time.monotonic() > end:
            raise CheckError(f"waited {seconds:g} s for {what}")
        time.sleep(_POLL)


def unit(name: str) -> str:
    """Return a property of the unit as systemd has it."""
    return must("systemctl", "show", "-P", name, SERVICE).strip()


def processes() -> dict[str, int]:
    """Return the service's processes: supervisor, loop, publisher, keeper, link NAME, each with its number."""
    found: dict[str, int] = {}
    for line in _GROUP.read_text().split() if _GROUP.exists() else []:
        try:
            words = Path(f"/proc/{line}/cmdline").read_bytes().decode().split("\0")
        except OSError:
            continue
        if "service.process" in words:
            role = words[words.index("service.process") + 1]
            found[f"link {words[words.index('--name') + 1]}" if role == "link" else role] = int(line)
        elif "run" in words:
            found["supervisor"] = int(line)
    return found


def status_of(pid: int) -> dict[str, str]:
    """Return what the kernel says of a process: Uid, CapEff, Seccomp, VmLck, VmRSS …"""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return {key: value.strip() for key, _, value in (line.partition(":") for line in lines)}


def journal(pattern: str) -> bool:
    """Tell whether the unit's journal has said something."""
    return run("journalctl", "-u", SERVICE, "--no-pager", "-q", "-g", pattern).stdout.strip() != ""


class Estimates:
    """A Zenoh subscriber as any client has it: the estimates of one vehicle, newest last."""

    def __init__(self, vehicle: str) -> None:
        self.arrived: deque[tuple[float, dict[str, Any]]] = deque(maxlen=2000)
        self.states: deque[dict[str, Any]] = deque(maxlen=50)
        self._session = until(self._opened, "a Zenoh session with the daemon")
        key = f"beliefd/v1/{vehicle}/"
        self._subscribers = [
            self._session.declare_subscriber(key + "estimate", self._take),
            self._session.declare_subscriber(key + "sensors", self._note),
        ]

    @staticmethod
    def _opened() -> zenoh.Session | None:
        settings = {
            "mode": "client",
            "connect": {"endpoints": ["tcp/127.0.0.1:7447"]},
            "scouting": {"multicast": {"enabled": False}},
        }
        try:
            return zenoh.open(zenoh.Config.from_json5(json.dumps(settings)))
        except zenoh.ZError:
            return None  # not there yet

    def _take(self, sample: zenoh.Sample) -> None:
        self.arrived.append((time.monotonic(), json.loads(sample.payload.to_bytes())))

    def _note(self, sample: zenoh.Sample) -> None:
        self.states.append(json.loads(sample.payload.to_bytes()))

    def newest(self) -> dict[str, Any] | None:
        """Return the last estimate that has arrived."""
        return self.arrived[-1][1] if self.arrived else None

    def after(self, moment: float) -> dict[str, Any] | None:
        """Return the newest estimate if it arrived after ``moment`` (monotonic seconds)."""
        return self.arrived[-1][1] if self.arrived and self.arrived[-1][0] > moment else None

    def located_after(self, moment: float) -> dict[str, Any] | None:
        """Return the newest estimate after ``moment`` that has a position."""
        newest = self.after(moment)
        return newest if newest and newest["position"][0] is not None else None

    def counts_anew(self, since: float) -> bool:
        """Tell whether the numbers of the estimates have begun again since then: another loop speaks."""
        numbers = [estimate["sequence"] for moment, estimate in self.arrived if moment > since - 1.0]
        return any(later < earlier for earlier, later in pairwise(numbers))

    def gap(self, since: float) -> float:
        """Return the longest time without an estimate from ``since`` to now, seconds."""
        times = [since, *(moment for moment, _ in self.arrived if moment > since), time.monotonic()]
        return max(later - earlier for earlier, later in pairwise(times))

    def link(self, name: str) -> dict[str, Any]:
        """Return how a link was by the last word on the sensors."""
        links = self.states[-1]["links"] if self.states else []
        return next((link for link in links if link["name"] == name), {})

    def carries_anew(self, name: str, before: int) -> bool:
        """Tell whether a link is up and counts its messages from the start again: another process reports."""
        link = self.link(name)
        return link.get("state") == "up" and 0 < link["messages"] < before

    def close(self) -> None:
        """End the session."""
        self._session.close()
