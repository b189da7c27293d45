"""``beliefd bench``: the cost of every stage, and the largest count inside the budget at each rate."""

from __future__ import annotations

import json
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from service.bench.measure import COUNTS, ROUNDS, Point, affordable, measure, shapes
from service.config import Configuration, load

EXAMPLE = {
    "vehicle": {"name": "bench"},
    "link": [{"name": "autopilot", "kind": "mavlink", "url": "udpin:127.0.0.1:0"}],
    "sensor": [{"kind": "range", "sigma": 0.3, "outliers": 0.05}],
    "beacon": [
        {"id": number, "position": position}
        for number, position in enumerate(
            [(20.0, 10.0, 0.0), (-5.0, 20.0, 0.0), (30.0, -15.0, 0.0), (-20.0, -10.0, 0.0)]
        )
    ],
}
"""A rover with wheels, a gyro and four beacons, where no configuration is given."""


def command(
    config: Path | None, rates: Sequence[float], share: float, as_json: bool, plot: Path | None
) -> int:
    """Run ``beliefd bench`` and return its exit status."""
    console = Console(stderr=as_json)
    if plot is not None and find_spec("matplotlib") is None:
        console.print("[red]--plot needs matplotlib: pip install 'beliefd[textbook]'[/red]", highlight=False)
        return 1
    configuration = Configuration.model_validate(EXAMPLE) if config is None else load(config)
    with Progress(console=console, transient=True) as bar:
        task = bar.add_task("measuring", total=ROUNDS * len(COUNTS))
        points = measure(configuration, COUNTS, lambda count: bar.advance(task))
    if as_json:
        print(json.dumps(figures(points, rates, share)))  # noqa: T201  the command's result
    else:
        show(points, rates, share, console)
    if plot is not None:
        from service.bench.plot import draw

        draw(points, [(rate, share / rate) for rate in rates], plot)
        console.print(f"  cost against count: {plot}", highlight=False)
    return 0


def figures(points: Sequence[Point], rates: Sequence[float], share: float) -> dict[str, object]:
    """Return what ``--json`` prints: microseconds, nanoseconds, counts."""
    return {
        "counts": [
            {
                "particles": point.count,
                "tick_us": round(1e6 * point.tick, 1),
                "least_us": round(1e6 * point.least, 1),
                "most_us": round(1e6 * point.most, 1),
                "stages_us": {stage: round(1e6 * cost, 1) for stage, cost in point.stages.items()},
            }
            for point in points
        ],
        "stages": {
            stage: {
                "overhead_us": round(1e6 * s.constant, 1),
                "ns_per_particle": round(1e9 * s.slope, 2),
            }
            for stage, s in shapes(points).items()
        },
        "affords": [
            {
                "rate": rate,
                "budget_ms": round(1e3 * share / rate, 3),
                "particles": affordable(points, share / rate),
            }
            for rate in rates
        ],
    }


def show(points: Sequence[Point], rates: Sequence[float], share: float, console: Console) -> None:
    """Print three tables: ticks, stages, and what fits."""
    ticks = _table("a tick, µs of processor time", "particles", "median", "least … most", "ns per particle")
    for point in points:
        ticks.add_row(
            f"{point.count:,}",
            f"{1e6 * point.tick:,.0f}",
            f"{1e6 * point.least:,.0f} … {1e6 * point.most:,.0f}",
            f"{1e9 * point.tick / point.count:.1f}",
        )
    stages = _table("its stages", "stage", "overhead µs", "ns per particle")
    for stage, shape in shapes(points).items():
        stages.add_row(stage, f"{1e6 * shape.constant:.0f}", f"{1e9 * shape.slope:.2f}")
    fits = _table(f"what fits, at {share:.0%} of a processor", "rate Hz", "budget ms", "particles")
    for rate in rates:
        count = affordable(points, share / rate)
        fits.add_row(f"{rate:g}", f"{1e3 * share / rate:g}", f"{count:,}" if count else "not even the fewest")
    for table in (ticks, stages, fits):
        console.print(table)


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1))
    for column in columns:
        table.add_column(column, justify="right")
    return table
