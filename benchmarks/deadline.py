"""Deadlines under load: the real daemon at a rate, beside a load, for SECONDS.

    python benchmarks/deadline.py --rate 100 --load link --flood 2000 --seconds 600      one run, told at length
    python benchmarks/deadline.py --matrix [--rates 50,100,200] [--seconds 30]           all loads, a table

Loads: ``idle`` (a calm link of 400 messages/s), ``stress`` (the same beside ``stress-ng --cpu 4 --vm 1``), ``link``
(FLOOD messages/s), ``stopped`` (a subscriber that is stopped with SIGSTOP). One process sends (traffic.py); a Zenoh
subscriber reads what the daemon says of itself (observation.py). Printed: missed ticks, lateness, use of the budget,
drops, level and count over time, memory of every process, and the time from the start of the daemon to its first
estimate. ``--matrix`` writes docs/performance.md.
"""

from __future__ import annotations

import argparse

import numpy as np
from observation import Outcome, run
from report import machine, write

LOADS = ("idle", "stress", "link", "stopped")
ORDINARY = ("idle", "stress")
"""Loads that the matrix also measures without SCHED_FIFO."""

CALM = 400
"""Messages per second of the vehicle where the link is not the load."""


def main() -> None:
    arguments = parse()
    if arguments.matrix:
        matrix(arguments)
    else:
        run(arguments)


def matrix(arguments: argparse.Namespace) -> None:
    """Run every load at every rate, and write the table."""
    outcomes: list[tuple[str, Outcome]] = []
    for priority in map(int, arguments.priorities.split(",")):
        loads = arguments.loads.split(",")
        for load in loads if priority else [load for load in loads if load in ORDINARY]:
            for rate in map(float, arguments.rates.split(",")):
                settings = vars(arguments) | {"rate": rate, "load": load, "priority": priority}
                settings["flood"] = arguments.flood if load == "link" else CALM
                print(f"--- {rate:g} Hz, {load}, priority {priority}", flush=True)
                kind = f"{load}, SCHED_FIFO {priority}" if priority else load
                outcomes.append((kind, run(argparse.Namespace(**settings))))
    write("deadline", table(outcomes, arguments))


def table(outcomes: list[tuple[str, Outcome]], arguments: argparse.Namespace) -> str:
    lines = [
        f"{arguments.seconds:g} s each, budget {arguments.budget:g} ms a tick. Lateness: from the deadline of a tick "
        "to its start, over the whole run. Levels: ticks at each. Faults: page faults per 1,000 ticks after the first "
        "five seconds.",
        "",
        "| load | Hz | ticks | missed | rested | cut | late, ms: 50 % | 99 % | 99.9 % | worst "
        "| count, median (10 to 90 %) | levels | faults |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for load, outcome in outcomes:
        last, late = outcome.last, outcome.last.run_lateness
        assert late is not None
        low, middle, high = np.percentile(outcome.counts or [0], (10, 50, 90))
        levels = ", ".join(f"{level}: {ticks}" for level, ticks in last.levels.items() if ticks)
        lines.append(
            f"| {load} | {last.rate:g} | {last.ticks} | {last.missed_ticks} | {last.rested_ticks} | {last.cut_ticks} "
            f"| {late.median:.2f} | {late.p99:.2f} | {late.p999:.2f} | {late.worst:.2f} "
            f"| {middle:.0f} ({low:.0f} to {high:.0f}) | {levels} | {outcome.faults:.1f} |"
        )
    return "\n".join([*lines, "", f"Machine: {machine()}. By `benchmarks/deadline.py` (in `make bench`)."])


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rate", type=float, default=100.0, help="ticks per second")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--flood", type=int, default=2000, help="MAVLink messages per second")
    parser.add_argument("--budget", type=float, default=4.0, help="ms per tick")
    parser.add_argument("--priority", type=int, default=0, help="SCHED_FIFO priority, 0: ordinary")
    parser.add_argument("--load", choices=LOADS, default="link")
    parser.add_argument("--matrix", action="store_true")
    parser.add_argument("--loads", default=",".join(LOADS), help="of the matrix")
    parser.add_argument("--priorities", default="10,0", help="of the matrix: SCHED_FIFO, 0: ordinary")
    parser.add_argument("--rates", default="50,100,200", help="of the matrix")
    return parser.parse_args()


if __name__ == "__main__":
    main()
