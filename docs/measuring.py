"""What the scripts that measure share: run ``beliefd``, keep what it counted, and write tables into accuracy.md.

Two of them may run side by side: file and page are read again, changed and written while no other does so.
"""

from __future__ import annotations

import fcntl
import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "accuracy.md"
KEPT = ROOT / "docs" / "honesty.json"


def told(arguments: list[str]) -> dict[str, Any] | str:
    """Run ``beliefd`` and return the object that it prints, or what it said where it failed."""
    command = [str(Path(sys.executable).with_name("beliefd")), *arguments, "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
    if done.returncode != 0:
        return " ".join(done.stderr.split())[-200:] or f"exit {done.returncode}"
    return json.loads(done.stdout)


@contextmanager
def alone() -> Iterator[None]:
    """Hold every other script that measures off for a moment."""
    with (ROOT / "docs").joinpath("measuring.py").open(encoding="utf-8") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def replace(path: Path, text: str) -> None:
    """Write a file at once or not at all, whoever reads it or interrupts."""
    part = path.with_name(path.name + ".part")
    part.write_text(text, encoding="utf-8")
    part.replace(path)


def everything() -> dict[str, Any]:
    """Return all that was counted so far: by part, then by name."""
    return json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.is_file() else {}


def keep(part: str, name: str, said: dict[str, Any], command: list[str]) -> None:
    """Keep what the runs of one command counted, where a later look makes tables and curves of it."""
    summary = said["summary"]
    levels = [run["levels"] for run in said["runs"] if run["levels"]]
    names = ("rmse_m", "max_m", "nees_mean", "log_score", "coverage_50", "coverage_95", "coverage_99")
    one = {
        "command": "beliefd " + " ".join(command),
        "levels": np.sum(levels, axis=0).tolist() if levels else [],
        "nees_bounds": summary["nees_bounds"],
        "checks": {check: [of["passed"], of["of"]] for check, of in summary["checks"].items()},
        **{name: summary[name] for name in names if name in summary},
    }
    with alone():
        kept = everything()
        kept.setdefault(part, {})[name] = one
        replace(KEPT, json.dumps(kept) + "\n")


def standing(markers: tuple[str, str]) -> str:
    """Return what stands in the page between two markers."""
    begin, end = markers
    return PAGE.read_text(encoding="utf-8").split(begin)[1].split(end)[0]


def put(markers: tuple[str, str], table: str) -> None:
    """Make anew what stands in the page between two markers; call it :func:`alone`."""
    begin, end = markers
    text = PAGE.read_text(encoding="utf-8")
    replace(PAGE, f"{text.split(begin)[0]}{begin}\n{table}\n{end}{text.split(end)[1]}")
