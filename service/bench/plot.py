"""Cost of a tick against the particle count, with the budget of every rate as a limit."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from service.bench.measure import Point

COLOURS = {
    "motion": "#0072b2",
    "sensing": "#e69f00",
    "witnesses": "#882255",
    "resampling": "#009e73",
    "extraction": "#cc79a7",
}


def draw(points: Sequence[Point], limits: Sequence[tuple[float, float]], path: Path) -> None:
    """Write the picture.

    Parameters
    ----------
    points : sequence of Point
        What was measured.
    limits : sequence of (rate, budget)
        Hz and seconds.
    path : Path
        Where to; the ending tells the format.
    """
    import matplotlib as mpl

    mpl.use("Agg")
    mpl.rcParams.update({"svg.hashsalt": "beliefd", "font.size": 11})
    from matplotlib.figure import Figure

    figure: Any = Figure(figsize=(7.5, 4.6), constrained_layout=True)
    axes: Any = figure.subplots()
    counts = [point.count for point in points]
    spread = [[1e3 * (p.tick - p.least) for p in points], [1e3 * (p.most - p.tick) for p in points]]
    axes.errorbar(
        counts,
        [1e3 * p.tick for p in points],
        yerr=spread,
        color="#000000",
        marker="o",
        capsize=3,
        label="tick",
    )
    for stage in (name for name, cost in points[0].stages.items() if cost > 0.0):
        axes.plot(
            counts,
            [1e3 * p.stages[stage] for p in points],
            color=COLOURS.get(stage),
            linewidth=1.2,
            label=stage,
        )
    for rate, budget in limits:
        axes.axhline(1e3 * budget, color="#d55e00", linewidth=1, linestyle="--")
        axes.annotate(
            f"budget at {rate:g} Hz", (counts[0], 1e3 * budget), xytext=(0, 3), textcoords="offset points",
            color="#d55e00", fontsize=9,
        )  # fmt: skip
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("particles")
    axes.set_ylabel("processor time per tick, ms")
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(visible=True, which="major", color="#dddddd", linewidth=0.7)
    figure.legend(frameon=False, loc="outside right center")
    figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None)
