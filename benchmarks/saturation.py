"""Error and missed deadlines against the particle count: a fixed count beside a budget.

    python benchmarks/saturation.py [--seconds 15] [--counts 1000,3000,...] [--repeats 1] [--draw-only]

The real loop runs in real time on simulated samples: a rover drives figures of eight at 3 m/s between four beacons,
with odometry, a gyro and four ranges per tick at 100 Hz. The filter is asked for a count. *Fixed* gives it whatever
that costs; *budgeted* pays for it from a budget of the tick. What counts is what a subscriber has: the last estimate
published by each instant, against where the rover is at that instant. Every point is a process of its own; the two
take turns. Rows go to docs/performance-saturation.csv, the picture to docs/performance-saturation.svg.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from pathlib import Path
from statistics import median
from typing import Any

import msgspec
import numpy as np
from report import machine, write

from service import kernels

kernels.prepare()

from drivers.sample import AnyReading, Odometer, Range, Rotation, Sample, SampleBatch, encode  # noqa: E402
from service.budget import Meters  # noqa: E402
from service.channels import Heart, Outlet, Pair, pair  # noqa: E402
from service.config import Configuration, load  # noqa: E402
from service.estimate import Estimate  # noqa: E402
from service.estimator import Estimator  # noqa: E402
from service.inlet import Inlet  # noqa: E402
from service.loop import Loop  # noqa: E402
from service.realtime import freeze_garbage, punctual  # noqa: E402
from service.rehearsal import rehearse  # noqa: E402

ROOT = Path(__file__).parents[1]
ROWS = ROOT / "docs" / "performance-saturation.csv"
PICTURE = ROOT / "docs" / "performance-saturation.svg"
COUNTS = "1000,3000,10000,30000,100000,300000,1000000,3000000"
RATE, BUDGET_MS, LEAST = 100.0, 5.0, 200
PERIOD_NS = round(1e9 / RATE)
SPEED, RADIUS, RANGE_SIGMA = 3.0, 8.5, 0.3
SPEED_SIGMA, YAW_RATE_SIGMA = 0.1, 0.02
BEACONS = {1: (2.0, 2.0), 2: (48.0, 4.0), 3: (46.0, 47.0), 4: (3.0, 45.0)}
SETTLED = 3.0
KINDS = ("fixed", "budgeted")
CONFIGURATION = """
[vehicle]
name = "rover"
[start]
position = [25.0, 25.0, 0.0]
heading = 0.0
sigma = [0.5, 0.5, 0.5]
[loop]
rate = {rate}
horizon_ms = 20
[budget]
cpu_ms = {budget}
particles_min = {least}
particles_max = {most}
[publish]
particles = 0
[[link]]
name = "radio"
kind = "mavlink"
url = "udpin:127.0.0.1:0"
[[sensor]]
kind = "range"
sigma = 0.3
outliers = 0.01
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seconds", type=float, default=15.0)
    parser.add_argument("--counts", default=COUNTS)
    parser.add_argument("--repeats", type=int, default=1)
    parser.add_argument("--priority", type=int, default=0, help="SCHED_FIFO, of both kinds; 0: ordinary")
    parser.add_argument("--draw-only", action="store_true")
    parser.add_argument("--point", default="", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.point:
        kind, _, count = arguments.point.partition(",")
        print(json.dumps(measure(kind, int(count), arguments.seconds, arguments.priority)))
        return
    if not arguments.draw_only:
        measure_all(arguments)
    rows = list(csv.DictReader(ROWS.open()))
    draw(rows)
    if not arguments.draw_only:
        write("saturation", table(rows))


def measure_all(arguments: argparse.Namespace) -> None:
    rows: list[dict[str, Any]] = []
    print(
        f"{'asked':>9} {'':>9} {'missed':>8} {'error m':>8} {'95 % m':>8} {'used':>9} {'tick ms':>8}  levels"
    )
    for _ in range(arguments.repeats):
        for count in map(int, arguments.counts.split(",")):
            for kind in KINDS:
                command = [
                    sys.executable,
                    __file__,
                    "--point",
                    f"{kind},{count}",
                    "--seconds",
                    str(arguments.seconds),
                    "--priority",
                    str(arguments.priority),
                ]
                done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
                row = json.loads(done.stdout)
                rows.append(row)
                print(f"{count:9d} {kind:>9} {row['missed']:8.2%} {row['rmse_m']:8.3f} {row['p95_m']:8.3f} "
                      f"{row['particles']:9.0f} {row['tick_ms']:8.2f}  {row['levels']}")  # fmt: skip
    with ROWS.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


# --- one point: the loop in real time -----------------------------------------------------------------


def truth(seconds: float) -> tuple[float, float]:
    """Return where the rover is: a figure of eight of two circles, driven at constant speed."""
    lap = 2.0 * math.pi * RADIUS / SPEED
    turn = SPEED / RADIUS * (seconds % lap)
    side = 1.0 if int(seconds / lap) % 2 == 0 else -1.0
    return 25.0 + RADIUS * math.sin(turn), 25.0 + side * RADIUS * (1.0 - math.cos(turn))


def yaw_rate(seconds: float) -> float:
    lap = 2.0 * math.pi * RADIUS / SPEED
    return SPEED / RADIUS * (1.0 if int(seconds / lap) % 2 == 0 else -1.0)


class Simulation:
    """The rover's messages as they come due, and the estimates as they come out; both between two ticks."""

    def __init__(self, samples: Pair, estimates: Pair, seconds: float) -> None:
        self._samples, self._estimates, self._seconds = samples, estimates, seconds
        self._random = np.random.default_rng(1)
        self._step = 0
        self._rolled = 0.0
        self.began = time.monotonic_ns()
        self.published: list[tuple[int, bytes]] = []

    def over(self) -> bool:
        now = time.monotonic_ns()
        while self.began + self._step * PERIOD_NS <= now:
            self.send(self._step, self.began + self._step * PERIOD_NS)
            self._step += 1
        with contextlib.suppress(BlockingIOError):
            while True:
                datagram = self._estimates.inlet.recv(1 << 18)
                if datagram[:1] == b"E":
                    self.published.append((now, datagram[1:]))
        return now >= self.began + self._seconds * 1e9

    def send(self, step: int, stamp: int) -> None:
        """Send what the rover says in one step; a driver would count what a full queue refuses."""
        with contextlib.suppress(BlockingIOError):
            self._samples.outlet.send(encode(SampleBatch(self._said(step / RATE, stamp))))

    def _said(self, elapsed: float, stamp: int) -> list[Sample]:
        north, east = truth(elapsed)
        noise = self._random.standard_normal(2 + len(BEACONS)).tolist()
        self._rolled += (SPEED + SPEED_SIGMA * math.sqrt(RATE) * noise[0]) / RATE
        turning = yaw_rate(elapsed) + YAW_RATE_SIGMA * math.sqrt(RATE) * noise[1]
        readings: list[AnyReading] = [Odometer((self._rolled, self._rolled)), Rotation(turning)]
        for (beacon, (n, e)), error in zip(BEACONS.items(), noise[2:], strict=True):
            readings.append(Range(beacon, math.hypot(north - n, east - e) + RANGE_SIGMA * error))
        return [Sample(stamp, stamp, "radio", "sim", reading) for reading in readings]

    def errors(self, estimates: list[Estimate]) -> list[float]:
        """Return how far off the last published estimate was at the time of every tick that was due."""
        errors: list[float] = []
        latest = 0
        for tick in range(round(SETTLED * RATE), round(self._seconds * RATE)):
            at = self.began + tick * PERIOD_NS
            while latest + 1 < len(estimates) and self.published[latest + 1][0] <= at:
                latest += 1
            north, east, _ = estimates[latest].position
            if north is not None and east is not None:
                here = truth(tick / RATE)
                errors.append(math.hypot(north - here[0], east - here[1]))
        return errors


def configured(kind: str, count: int) -> Configuration:
    beacons = "".join(f"[[beacon]]\nid = {i}\nposition = [{n}, {e}, 0.0]\n" for i, (n, e) in BEACONS.items())
    least = count if kind == "fixed" else min(LEAST, count)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rover.toml"
        path.write_text(CONFIGURATION.format(rate=RATE, budget=BUDGET_MS, least=least, most=count) + beacons)
        configuration = load(path)
    if kind == "fixed":  # what no configuration allows
        unlimited = configuration.budget.model_copy(update={"cpu_ms": 1e6})
        configuration = configuration.model_copy(update={"budget": unlimited})
    return configuration


def measure(kind: str, count: int, seconds: float, priority: int) -> dict[str, Any]:
    configuration = configured(kind, count)
    samples, estimates, heart = pair(1 << 21), pair(1 << 21), pair(1 << 16)
    meters = Meters(RATE)
    estimator = Insatiable(configuration, meters)
    inlet, outlet, pulse = Inlet("radio", samples.inlet), Outlet(estimates.outlet), Heart(heart.outlet)
    loop = Loop(configuration, estimator, meters, [inlet], outlet, pulse, rehearse(configuration))
    for refusal in punctual(priority, ()):
        print(refusal, file=sys.stderr)
    freeze_garbage()
    simulation = Simulation(samples, estimates, seconds)
    loop.run(simulation.over)
    decoded = [msgspec.json.decode(payload, type=Estimate) for _, payload in simulation.published]
    errors = simulation.errors(decoded)
    levels = Counter(estimate.level for estimate in decoded)
    return {
        "kind": kind,
        "asked": count,
        "missed": loop.missed_ticks / (loop.ticks + loop.missed_ticks),
        "rmse_m": math.sqrt(sum(error * error for error in errors) / max(1, len(errors))),
        "p95_m": sorted(errors)[int(0.95 * len(errors))] if errors else math.nan,
        "particles": median(estimate.particles for estimate in decoded),
        "tick_ms": 1e3 * meters.durations.quantile(0.5),
        "levels": " ".join(f"{level}:{number}" for level, number in sorted(levels.items())),
        "priority": priority,
        "load": os.getloadavg()[0],
    }


class Insatiable(Estimator):
    """Demands the count asked for, whatever the spread of its belief."""

    def __init__(self, configuration: Configuration, stopwatch: Meters) -> None:
        super().__init__(configuration, stopwatch)
        self._population.demand_of = lambda belief: configuration.budget.particles_max


def table(rows: list[dict[str, str]]) -> str:
    lines = [
        "![Error and missed deadlines against the particles asked for](performance-saturation.svg)",
        "",
        f"{RATE:g} Hz, SCHED_FIFO priority {rows[0]['priority']} (0: ordinary), budget {BUDGET_MS:g} ms a tick. "
        "Error: of the last estimate published by each instant, against the truth at that instant.",
        "",
        "| asked for | | used (median) | tick ms (median) | deadlines missed | error m (RMS) | 95 % m |",
        "|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {int(row['asked']):,} | {row['kind']} | {float(row['particles']):,.0f} | {float(row['tick_ms']):.1f} | "
        f"{float(row['missed']):.1%} | {float(row['rmse_m']):.3f} | {float(row['p95_m']):.3f} |"
        for row in sorted(rows, key=lambda row: (int(row["asked"]), row["kind"]))
    ]
    return "\n".join([*lines, "", f"Machine: {machine()}. By `python benchmarks/saturation.py`."])


# --- the picture --------------------------------------------------------------------------------------


def draw(rows: list[dict[str, str]]) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    mpl.rcParams.update(
        {"svg.hashsalt": "beliefd", "font.size": 11, "axes.spines.top": False, "axes.spines.right": False}
    )
    figure, panels = plt.subplots(3, 1, sharex=True, figsize=(7.5, 7.0), constrained_layout=True)
    above, below, used = panels
    looks = {
        "fixed": ("#d55e00", "o", "fixed count"),
        "budgeted": ("#0072b2", "s", f"budget, {BUDGET_MS:g} ms a tick"),
    }
    for kind, (colour, mark, label) in looks.items():
        of_kind: dict[int, list[dict[str, str]]] = defaultdict(list)
        for row in rows:
            if row["kind"] == kind:
                of_kind[int(row["asked"])].append(row)
        counts = sorted(of_kind)
        for axes, name, scale in ((above, "rmse_m", 1.0), (below, "missed", 100.0), (used, "particles", 1.0)):
            each = [[scale * float(row[name]) for row in of_kind[count]] for count in counts]
            middle = [median(values) for values in each]
            spread = [
                [m - min(v) for m, v in zip(middle, each, strict=True)],
                [max(v) - m for m, v in zip(middle, each, strict=True)],
            ]
            axes.errorbar(counts, middle, yerr=spread, color=colour, marker=mark, label=label, capsize=3)
    above.set_xscale("log")
    above.set_yscale("log")
    above.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    above.set_ylabel("error of what is\npublished, m (RMS)")
    below.set_ylabel("deadlines\nmissed, %")
    used.set_yscale("log")
    used.set_ylabel("particles used\n(median)")
    used.set_xlabel(f"particles asked for, {RATE:g} ticks per second")
    below.set_ylim(-3, 103)
    above.legend(frameon=False, loc="upper left")
    for axes in panels:
        axes.grid(visible=True, which="major", color="#dddddd", linewidth=0.7)
    figure.savefig(PICTURE, metadata={"Date": None})
    print(f"{PICTURE.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
