"""The filter beside those of other libraries: time and error of one workload, in one run, in turns.

    python benchmarks/compare.py [--counts 1000,10000,100000] [--rounds 7]

The others come from the package index, into an environment of their own (.venv-compare: particles needs numpy < 2).
Every contender of benchmarks/contenders.py is a process; they step in turns, so that whatever else the machine does
befalls all of them. Processor time per step; RMSE beside it, so that nobody is fast by being wrong. Writes a section
and a figure of docs/performance.md.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import venv
from pathlib import Path
from statistics import median
from typing import Any

from report import ROOT, machine, write

OTHERS = ROOT / ".venv-compare"
PACKAGES = ("numpy<2", "particles==0.4", "pfilter==0.2.5", "filterpy", "stonesoup==1.9.1")
NAMES = ("beliefd", "numpy", "particles", "stonesoup", "pfilter", "filterpy")
TITLES = {"numpy": "numpy float64", "stonesoup": "Stone Soup"}
ROUND_SECONDS = 0.4
WARM, FEWEST = 23, 10
"""Steps before the rounds, which do not count; and the least of a round."""

PICTURE = ROOT / "docs" / "performance-compare.svg"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--counts", default="1000,10000,100000")
    parser.add_argument("--rounds", type=int, default=7)
    arguments = parser.parse_args()
    counts = [int(text) for text in arguments.counts.split(",")]
    prepare()
    found = {count: compare(count, arguments.rounds) for count in counts}
    draw(found)
    write("compare", table(found, arguments.rounds))


def prepare() -> None:
    if not (OTHERS / "bin" / "python").exists():
        print(f"installing {', '.join(PACKAGES)} into {OTHERS.name}", flush=True)
        venv.create(OTHERS, with_pip=True)
    subprocess.run([OTHERS / "bin" / "python", "-m", "pip", "install", "--quiet", *PACKAGES], check=True)


class Contender:
    def __init__(self, name: str, count: int) -> None:
        interpreter = sys.executable if name in ("beliefd", "numpy") else str(OTHERS / "bin" / "python")
        threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        self._process = subprocess.Popen(
            [interpreter, str(Path(__file__).with_name("contenders.py")), name, str(count)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
            env=os.environ | threads,
        )  # fmt: skip
        self.costs: list[float] = []
        self.squares: list[float] = []
        self.run(3)  # compiles, where it does
        self.fitting = round(ROUND_SECONDS * 1e9 / self.run(WARM - 3)["ns"])
        """Steps that a round of its own would hold."""

    def run(self, steps: int) -> dict[str, Any]:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(f"{steps}\n")
        self._process.stdin.flush()
        return json.loads(self._process.stdout.readline())

    def round(self, steps: int) -> None:
        done = self.run(steps)
        self.costs.append(done["ns"])
        self.squares += done["squares"]

    def end(self) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()


def compare(count: int, rounds: int) -> dict[str, dict[str, float]]:
    contenders = {name: Contender(name, count) for name in NAMES}
    # the same steps for all: an error over others would be another error
    steps = max(FEWEST, min(contender.fitting for contender in contenders.values()))
    for _ in range(rounds):
        for contender in contenders.values():
            contender.round(steps)
    found: dict[str, dict[str, float]] = {}
    for name, contender in contenders.items():
        contender.end()
        ratios = [cost / own for cost, own in zip(contender.costs, contenders["beliefd"].costs, strict=True)]
        found[name] = {
            "us": median(contender.costs) / 1e3, "low": min(contender.costs) / 1e3, "high": max(contender.costs) / 1e3,
            "ratio": median(ratios), "ratio_low": min(ratios), "ratio_high": max(ratios),
            "rmse": math.sqrt(sum(contender.squares) / len(contender.squares)), "steps": len(contender.squares),
        }  # fmt: skip
        print(f"{count:8d} {name:>10} {found[name]['us']:10.1f} us  x{found[name]['ratio']:6.1f}  "
              f"RMSE {found[name]['rmse']:.4f} m over {found[name]['steps']:.0f} steps", flush=True)  # fmt: skip
    return found


def table(found: dict[int, dict[str, dict[str, float]]], rounds: int) -> str:
    lines = [
        "![Time per step against the particle count, six libraries](performance-compare.svg)",
        "",
        f"Median of {rounds} rounds in turns, processor time on one core (least to greatest round), beside the "
        "ratio to beliefd in the same round.",
        "",
        "| particles | library | µs per step | ns per particle | times beliefd | RMSE m |",
        "|---|---|---|---|---|---|",
    ]
    for count, rows in found.items():
        for name, row in rows.items():
            ratio = (
                "1"
                if name == "beliefd"
                else f"{row['ratio']:.1f} ({row['ratio_low']:.1f} to {row['ratio_high']:.1f})"
            )
            lines.append(
                f"| {count:,} | {TITLES.get(name, name)} "
                f"| {row['us']:,.0f} ({row['low']:,.0f} to {row['high']:,.0f}) "
                f"| {1e3 * row['us'] / count:.1f} | {ratio} | {row['rmse']:.3f} |"
            )
    return "\n".join([*lines, "", f"Machine: {machine()}. By `python benchmarks/compare.py`."])


def draw(found: dict[int, dict[str, dict[str, float]]]) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    mpl.rcParams.update(
        {"svg.hashsalt": "beliefd", "font.size": 11, "axes.spines.top": False, "axes.spines.right": False}
    )
    figure, axes = plt.subplots(figsize=(7.5, 4.4), constrained_layout=True)
    counts = sorted(found)
    looks = zip(
        NAMES, ("#0072b2", "#000000", "#009e73", "#cc79a7", "#e69f00", "#d55e00"), "os^vDX", strict=True
    )
    for name, colour, mark in looks:
        middle = [found[count][name]["us"] for count in counts]
        below = [found[count][name]["us"] - found[count][name]["low"] for count in counts]
        above = [found[count][name]["high"] - found[count][name]["us"] for count in counts]
        axes.errorbar(counts, middle, yerr=[below, above], color=colour, marker=mark, capsize=3,
                      linewidth=2.4 if name == "beliefd" else 1.3, label=TITLES.get(name, name))  # fmt: skip
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.axhline(10_000, color="#888888", linewidth=1, linestyle="--")
    axes.annotate(
        "a tick at 100 Hz", (counts[0], 10_000), textcoords="offset points", xytext=(0, 4), color="#555555"
    )
    axes.set_xlabel("particles")
    axes.set_ylabel("µs of one core per step")
    axes.grid(visible=True, which="major", color="#dddddd", linewidth=0.7)
    axes.legend(frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    figure.savefig(PICTURE, metadata={"Date": None})


if __name__ == "__main__":
    main()
