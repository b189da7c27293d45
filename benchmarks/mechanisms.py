"""What each mechanism of [honesty] costs in a tick, into its section of docs/performance.md.

    python benchmarks/mechanisms.py [--seconds 60] [--rounds 3]

The bytes of a few scenarios are turned into ticks once. The estimator does them all with every switch on and with each
switch off, in turns, alone in this process; what is told is processor time per tick, and by how much it is less with
the switch off. A belief that is without a mechanism is another one (it may be of several places, or lost), so these
are figures of what a user would see who switches it off, not of its code alone.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path
from statistics import median

from report import machine, write

from service import kernels

kernels.prepare()

from service.config import Configuration  # noqa: E402
from service.estimator import Estimator  # noqa: E402
from service.replay.run import Plan, Source  # noqa: E402
from service.replay.site import setting_of  # noqa: E402
from service.replay.ticks import Tick  # noqa: E402
from service.scenario import simulate  # noqa: E402
from service.switches import switched_off  # noqa: E402

SCENARIOS = {
    "beacons": "wheels, gyro, ranges 20 times a second",
    "multipath": "wheels, gyro, fixes and velocities 5 times a second each",
    "mirror": "ranges of two beacons, two hypotheses until the turn",
}
SWITCHES = ("hypotheses", "recovery", "trust", "motion_mode", "noise_learning", "lasting_errors")
ALL_ON = ""
PARTICLES = 2000
SEED = 1


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    found = {name: measured(name, arguments.seconds, arguments.rounds) for name in SCENARIOS}
    write("mechanisms", table(found))


def measured(name: str, seconds: float, rounds: int) -> dict[str, list[float]]:
    """Return milliseconds per tick of each round, by the switch that is off."""
    with tempfile.TemporaryDirectory() as folder:
        stem = Path(folder) / name
        simulate(name, SEED, stem, seconds)
        logs = (stem.with_name(name + ".tlog"),)
        configuration = setting_of(logs, None, None).configuration
        ticks = list(Source(Plan(logs, configuration, PARTICLES)).ticks())
    spent: dict[str, list[float]] = {switch: [] for switch in (ALL_ON, *SWITCHES)}
    for turn in range(rounds + 1):
        for switch, times in spent.items():
            milliseconds = run(switched_off(configuration, (switch,) if switch else ()), ticks)
            if turn:  # the one before them warms up
                times.append(milliseconds)
        print(name, {switch or "all on": f"{times[-1]:.3f}" for switch, times in spent.items() if times})
    return spent


def run(configuration: Configuration, ticks: list[Tick]) -> float:
    """Return the processor time of a tick, in milliseconds."""
    estimator = Estimator(configuration, seed=SEED)
    began = time.process_time()
    for tick in ticks:
        estimator.ingest(tick.samples)
        estimator.tick(tick.now, tick.unix, tick.afforded)
    return 1e3 * (time.process_time() - began) / len(ticks)


def table(found: dict[str, dict[str, list[float]]]) -> str:
    lines = [
        f"| {' | '.join(('', *(f'`{name}`' for name in found)))} |",
        f"|{'---|' * (len(found) + 1)}",
        f"| a tick with all of them, ms | {' | '.join(f'{median(of[ALL_ON]):.3f}' for of in found.values())} |",
    ]
    for switch in SWITCHES:
        cells = [
            f"{median(less):+.3f} ({min(less):+.3f} to {max(less):+.3f})"
            for less in (
                [on - off for on, off in zip(of[ALL_ON], of[switch], strict=True)] for of in found.values()
            )
        ]
        lines.append(f"| `{switch}` | {' | '.join(cells)} |")
    heard = ";\n".join(f"`{name}`: {what}" for name, what in SCENARIOS.items())
    lines += [
        "",
        f"Median (least to greatest) over rounds in turns, {PARTICLES:,} particles at most, 50 ticks a second.",
        f"{heard}.",
    ]
    return "\n".join([*lines, "", f"Machine: {machine()}. By `python benchmarks/mechanisms.py`."])


if __name__ == "__main__":
    main()
