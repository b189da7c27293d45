"""What is asked of the kernel, seen from processes of their own, with and without the right to it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

ASK = """
import gc, json, os, resource, sys
sys.path.insert(0, sys.argv[1])
from service.realtime import freeze_garbage, punctual
if sys.argv[2] == "poor":
    resource.setrlimit(resource.RLIMIT_MEMLOCK, (65536, 65536))
    resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
    os.setgroups([]); os.setgid(65534); os.setuid(65534)
refusals = punctual(int(sys.argv[3]), json.loads(sys.argv[4]))
freeze_garbage()
locked = [line for line in open("/proc/self/status") if line.startswith("VmLck")]
print(json.dumps({
    "refusals": refusals,
    "policy": os.sched_getscheduler(0),
    "cpus": sorted(os.sched_getaffinity(0)),
    "locked": int(locked[0].split()[1]),
    "collecting": gc.isenabled(),
    "frozen": gc.get_freeze_count(),
}))
"""


def ask(means: str, priority: int, cpus: list[int]) -> dict[str, object]:
    result = subprocess.run(
        [sys.executable, "-c", ASK, str(ROOT), means, str(priority), json.dumps(cpus)],
        capture_output=True,
        text=True,
        check=True,
    )
    return dict(json.loads(result.stdout))


root_only = pytest.mark.skipif(os.geteuid() != 0, reason="needs root, to have rights and to give them up")


@root_only
def test_takes_what_it_is_allowed() -> None:
    there = sorted(os.sched_getaffinity(0))
    got = ask("rich", 5, there[:1])
    assert got["refusals"] == []
    assert got["policy"] == os.SCHED_FIFO
    assert got["cpus"] == there[:1]
    assert isinstance(got["locked"], int)
    assert got["locked"] > 1000


@root_only
def test_runs_on_without_and_says_in_one_line_each_what_was_refused() -> None:
    refusals = ask("poor", 5, [])["refusals"]
    assert isinstance(refusals, list)
    assert len(refusals) == 2
    assert "memory is not locked: limited to 64 KiB; LimitMEMLOCK=infinity" in refusals[0]
    assert "loop.priority 5" in refusals[1]
    assert "LimitRTPRIO=5" in refusals[1]


def test_asks_for_nothing_that_was_not_configured() -> None:
    got = ask("rich", 0, [])
    assert got["policy"] == os.SCHED_OTHER
    assert got["cpus"] == sorted(os.sched_getaffinity(0))


def test_processors_that_are_not_there_are_named() -> None:
    refusals = ask("rich", 0, [999])["refusals"]
    assert isinstance(refusals, list)
    assert any("loop.cpus [999]" in refusal and "to choose from" in refusal for refusal in refusals)


def test_no_garbage_is_collected_any_more() -> None:
    got = ask("rich", 0, [])
    assert got["collecting"] is False
    assert isinstance(got["frozen"], int)
    assert got["frozen"] > 1000


PARENT = """
import os, subprocess, sys
sys.path.insert(0, sys.argv[1])
child = subprocess.Popen([sys.executable, "-c", sys.argv[2], sys.argv[1], str(os.getpid())],
                         stdout=subprocess.PIPE)
child.stdout.readline()
print(child.pid, flush=True)
os.kill(os.getpid(), 9)
"""
CHILD = """
import sys, time
sys.path.insert(0, sys.argv[1])
from service.realtime import die_with_parent
die_with_parent(int(sys.argv[2]))
print("here", flush=True)
time.sleep(60)
"""


def test_dies_with_its_parent() -> None:
    parent = subprocess.run(
        [sys.executable, "-c", PARENT, str(ROOT), CHILD], stdout=subprocess.PIPE, text=True, check=False
    )
    pid = int(parent.stdout)
    until = time.monotonic() + 10.0
    while _lives(pid):
        assert time.monotonic() < until
        time.sleep(0.01)


def test_does_not_start_without_its_parent() -> None:
    orphan = subprocess.run(
        [sys.executable, "-c", CHILD, str(ROOT), "1"], capture_output=True, text=True, check=False
    )
    assert orphan.returncode == 1
    assert "the supervisor (1) ended" in orphan.stderr


def _lives(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False
