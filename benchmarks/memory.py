"""Memory in steady state: page faults and resident memory of the real loop over many ticks, as fast as they go.

    python benchmarks/memory.py [--ticks 20000] [--particles 3000]

The loop and the estimator of the daemon in one process, memory set up as in the daemon, on the samples of
benchmarks/saturation.py. Prints what every tenth of the run added; after the first all should be zero. Writes
docs/performance.md.
"""

from __future__ import annotations

import argparse
import contextlib
import resource
from pathlib import Path

import saturation as rover
from report import machine, write

from service.budget import Meters
from service.channels import Heart, Outlet, pair
from service.inlet import Inlet
from service.loop import Loop
from service.realtime import freeze_garbage, punctual
from service.rehearsal import rehearse

PAGE_KIB = resource.getpagesize() // 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--ticks", type=int, default=20_000)
    parser.add_argument("--particles", type=int, default=3_000)
    arguments = parser.parse_args()
    configuration = rover.configured("budgeted", arguments.particles)
    samples, estimates, heart = pair(1 << 21), pair(1 << 21), pair(1 << 16)
    meters = Meters(rover.RATE)
    estimator = rover.Insatiable(configuration, meters)
    inlet, outlet, pulse = Inlet("radio", samples.inlet), Outlet(estimates.outlet), Heart(heart.outlet)
    loop = Loop(configuration, estimator, meters, [inlet], outlet, pulse, rehearse(configuration))
    punctual(0, ())
    freeze_garbage()
    simulation = rover.Simulation(samples, estimates, 1e9)
    room = bytearray(1 << 18)
    tenth = max(1, arguments.ticks // 10)
    faults, resident = page_faults(), resident_kib()
    rows: list[tuple[int, float, int, int]] = []
    print("  ticks  page faults per 1,000  resident KiB  grown KiB")
    for number in range(1, 10 * tenth + 1):
        now = simulation.began + number * rover.PERIOD_NS
        simulation.send(number, now)
        loop.tick(now)
        meters.end(0.0, 0.0)
        for end in (estimates.inlet, heart.inlet):
            with contextlib.suppress(BlockingIOError):
                while True:
                    end.recv_into(room)
        if number % tenth == 0:
            before, faults = faults, page_faults()
            then, resident = resident, resident_kib()
            rows.append((number, 1e3 * (faults - before) / tenth, resident, resident - then))
            print("{:7d} {:22.2f} {:13d} {:10d}".format(*rows[-1]), flush=True)
    write("memory", table(rows, arguments.particles))


def table(rows: list[tuple[int, float, int, int]], particles: int) -> str:
    lines = [
        f"The loop as fast as it goes, {particles:,} particles at most, four ranges in each tick.",
        "",
        "| ticks | page faults per 1,000 | resident KiB | grown KiB |",
        "|---|---|---|---|",
    ]
    lines += [
        f"| {ticks:,} | {faults:.2f} | {resident:,} | {grown:,} |" for ticks, faults, resident, grown in rows
    ]
    return "\n".join([*lines, "", f"Machine: {machine()}. By `python benchmarks/memory.py`."])


def page_faults() -> int:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_minflt + usage.ru_majflt


def resident_kib() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE_KIB


if __name__ == "__main__":
    main()
