"""The full step of the filter, timed in one interleaved run beside C by hand and plain numpy float64.

    python benchmarks/step.py [--counts 1000,10000,100000,1000000] [--block 16384] [--models] [--json FILE]

Blended over the steps that resample and those that do not. Every round times some steps of each program in turn, so
a machine that is busy is busy for all; the table gives the median round, its spread over the rounds (10th to 90th
percentile), and the ratios within rounds. Processor time; with --threads 2 wall time, for both.
"""

from __future__ import annotations

import argparse
import json
import math
import platform
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from service import kernels

kernels.prepare()  # numba's own cache would not notice a change in a function that was inlined

import models  # noqa: E402
import workload  # noqa: E402

from service.crew import Threads  # noqa: E402

ROUNDS = 12
STEPS = {1_000: 100, 10_000: 40, 100_000: 20, 1_000_000: 6}
"""Steps of a round; numpy does a quarter of them."""

WARM = 2
"""Rounds that are not counted."""

Makers = dict[str, Callable[[], workload.Step]]


def rounds(makers: Makers, count: int) -> dict[str, dict[str, Any]]:
    """Return for each program the costs of its rounds, nanoseconds per step, and its error."""
    each = STEPS.get(count, 20)
    ticks = workload.trajectory(each * (ROUNDS + WARM))
    programs = {name: make() for name, make in makers.items()}
    costs: dict[str, list[float]] = {name: [] for name in programs}
    squares: dict[str, list[float]] = {name: [] for name in programs}
    for first in range(0, len(ticks), each):
        for name, step in programs.items():
            spent: list[float] = []
            for tick in ticks[first : first + each]:
                north, east, cost = step(tick)
                spent.append(cost)
                squares[name].append((north - tick.truth[0]) ** 2 + (east - tick.truth[1]) ** 2)
            costs[name].append(statistics.fmean(spent))
    return {
        name: {"costs": costs[name][WARM:], "rmse": math.sqrt(statistics.fmean(squares[name]))}
        for name in programs
    }


def low_high(values: list[float]) -> tuple[float, float]:
    low, high = np.quantile(values, (0.1, 0.9))
    return float(low), float(high)


def compare(count: int, block: int, library: Any) -> dict[str, Any]:
    makers: Makers = {"beliefd": lambda: workload.product(count, block)}
    if library is not None:
        makers["limit.c"] = lambda: workload.by_hand(library, count)
    makers["numpy"] = lambda: workload.plain_numpy(count)
    result: dict[str, Any] = {"count": count}
    measured = rounds(makers, count)
    for name, values in measured.items():
        ours = measured["beliefd"]["costs"]
        ratios = [cost / own for cost, own in zip(values["costs"], ours, strict=True)]
        low, high = low_high(values["costs"])
        result[name] = {
            "us_per_step": statistics.median(values["costs"]) / 1e3,
            "us_low": low / 1e3,
            "us_high": high / 1e3,
            "ns_per_particle": statistics.median(values["costs"]) / count,
            "times_beliefd": statistics.median(ratios),
            "rmse_m": values["rmse"],
        }
    return result


def speed_up(count: int, block: int, threads: int) -> dict[str, float]:
    """Return the wall time of a step with one thread over that with several."""
    crew = Threads(threads)
    makers: Makers = {
        "one": lambda: workload.product(count, block, None, time.perf_counter_ns),
        "crew": lambda: workload.product(count, block, crew, time.perf_counter_ns),
    }
    measured = rounds(makers, count)
    crew.close()
    ratios = [a / b for a, b in zip(measured["one"]["costs"], measured["crew"]["costs"], strict=True)]
    return {"count": count, "threads": threads, "speed_up": statistics.median(ratios)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--counts", default="1000,10000,100000,1000000")
    parser.add_argument("--block", type=int, default=16384)
    parser.add_argument("--models", action="store_true", help="every model and stage by itself")
    parser.add_argument("--threads", type=int, default=1, help="how much faster so many threads are")
    parser.add_argument("--json", type=Path, help="write the figures here")
    arguments = parser.parse_args()
    library = workload.build()
    name = workload.compiler()
    print(
        f"{platform.processor() or platform.machine()}, Python {platform.python_version()}, limit.c by {name}"
    )
    if library is not None and name is not None and not name.startswith("clang"):
        print(f"{name} leaves limit.c's loops scalar: its ratio flatters; install clang")
    counts = [int(text) for text in arguments.counts.split(",")]
    report: dict[str, Any] = {"compiler": name, "block": arguments.block, "steps": []}
    print(
        f"\n{'particles':>9} {'program':>8} {'µs/step':>9} {'10 to 90 %':>17} {'ns/particle':>11} {'ratio':>6}  RMSE m"
    )
    for count in counts:
        row = compare(count, arguments.block, library)
        report["steps"].append(row)
        for program in ("beliefd", "limit.c", "numpy"):
            if program in row:
                p = row[program]
                print(
                    f"{count:9d} {program:>8} {p['us_per_step']:9.1f} {p['us_low']:8.1f} {p['us_high']:8.1f} "
                    f"{p['ns_per_particle']:11.2f} {p['times_beliefd']:6.2f}  {p['rmse_m']:.3f}"
                )
    if arguments.models:
        report["models"] = {count: models.table(count, arguments.block) for count in (10_000, 100_000)}
        print(f"\n{'ns per particle':30} {'at 10,000':>10} {'at 100,000':>10}")
        for model, few in report["models"][10_000].items():
            print(f"{model:30} {few:10.2f} {report['models'][100_000][model]:10.2f}")
    if arguments.threads > 1:
        report["threads"] = [
            speed_up(count, arguments.block, arguments.threads) for count in counts if count >= 100_000
        ]
        for row in report["threads"]:
            print(f"{row['count']} particles, {row['threads']} threads: {row['speed_up']:.2f} times as fast")
    if arguments.json:
        arguments.json.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
