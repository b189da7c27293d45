"""Measure whether what is claimed is observed, and what each mechanism is worth: ``make honesty`` (``SEEDS=5``).

Every scenario is run by the command that a user would type, and what it counted is kept in honesty.json, beside what
``make accuracy`` counted of the recordings: where one is absent, what was measured last stands. The recordings that a
mechanism matters to are replayed without it, too. Of that are made the calibration curves (honesty-calibration.svg) and
three tables of accuracy.md. ``--only NAME`` measures what holds that name, ``--draw-only`` nothing.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator
from io import StringIO
from pathlib import Path
from typing import Any

import matplotlib as mpl
import measuring
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

FOLDER = Path(__file__).parent
PICTURE = FOLDER / "honesty-calibration.svg"
CALIBRATION = ("<!-- calibration: begin -->", "<!-- calibration: end -->")
CHECKS = ("<!-- checks: begin -->", "<!-- checks: end -->")
ABLATION = ("<!-- ablation: begin -->", "<!-- ablation: end -->")
HOUR = "multipath, an hour"
"""A tenth of the seeds: it is long."""

SCENARIOS = ("beacons", "mirror", "kidnap", "late_fix", "spoof", "multipath", "slip", "jam", "outage")
TRACES = {
    "sitl_jam": ["../shared/data/sitl_jam.tlog"],
    "plaza2, from anywhere, second half": [
        *("../shared/data/plaza2.tlog", "--config", "out/accuracy/plaza2_field.toml"),
        *("--truth", "out/accuracy/plaza2_truth_second_half.csv"),
    ],
}
"""Recordings to which the mechanisms matter, by the name that ``make accuracy`` gives them, with what replays them."""

SWITCHES = ("hypotheses", "recovery", "trust", "motion_mode", "noise_learning", "lasting_errors")
LIED_TO = ("kidnap",)
"""Scenarios whose start is a lie told with certainty: no belief can be right until the evidence comes."""

TRIMMED = "trimmed"
"""Copies of a recording: they have their row, but do not count in the mean once more."""

AGAINST = "against"
"""Rows whose truth is none: it was made of what the belief hears, and so has part of its errors."""

MARGIN = 4.0
"""Points by which observed may differ from claimed."""

COLOURS = ("#2166ac", "#d95f02", "#1b7837", "#b2182b", "#7b3294", "#666666", "#008b8b", "#a6761d")
DASHES = ("-", "--", ":")


def wanted(seeds: int) -> Iterator[tuple[str, str, list[str]]]:
    """Yield every measurement: which part of the file, its name there, the command."""
    for name in SCENARIOS:
        yield "scenarios", name, ["scenario", name, "--seeds", str(seeds)]
    hours = ["scenario", "multipath", "--seconds", "3600", "--seeds", str(max(1, seeds // 10))]
    yield "scenarios", HOUR, hours
    for switch in SWITCHES:
        for name in SCENARIOS:
            command = ["scenario", name, "--seeds", str(seeds), "--without", switch]
            yield f"without {switch}", name, command
        for name, logs in TRACES.items():
            command = ["replay", *logs, "--seeds", str(seeds), "--without", switch]
            yield f"without {switch}", name, command


def measure(seeds: int, only: str, part_only: str) -> None:
    """Run what is wanted, and write down each result as it comes."""
    for part, name, command in wanted(seeds):
        if only not in name or part_only not in part:
            continue
        print(f"{part}: {name}", flush=True)
        said = measuring.told(command)
        if isinstance(said, str):
            print(f"  beliefd {' '.join(command)}: {said}", flush=True)
            continue
        measuring.keep(part, name, said, command)
        write_page()


def curve(levels: list[int]) -> np.ndarray:
    """Return the observed share at every claimed one: 0, 0.01 … 1; (101,)."""
    counts = np.asarray(levels, float)
    return np.concatenate([[0.0], np.cumsum(counts) / counts.sum()])


def once(name: str) -> bool:
    """Say whether nobody lied to a row, and it is no copy of another."""
    return name not in LIED_TO and TRIMMED not in name


def counts(name: str) -> bool:
    """Say whether a row counts in the mean: its truth is one, too."""
    return once(name) and AGAINST not in name


def curves(kept: dict[str, Any], part: str) -> dict[str, np.ndarray]:
    """Return the curves of a part, by name, of whatever had a truth and counts."""
    told = {name: one for name, one in kept.get(part, {}).items() if counts(name)}
    return {name: curve(one["levels"]) for name, one in told.items() if one["levels"]}


def plain(name: str) -> str:
    """Return a name without the marks of the page, as far as it tells one row from another."""
    return ",".join(name.replace("`", "").split(",")[:2])


def panel(axis: Axes, of: dict[str, np.ndarray], title: str) -> None:
    """Draw the curves of one part, and all of them together."""
    claimed = np.linspace(0.0, 100.0, 101)
    axis.fill_between(claimed, claimed - MARGIN, claimed + MARGIN, color="#d9d9d9", lw=0)
    axis.plot(claimed, claimed, color="black", lw=0.6)
    for index, (name, observed) in enumerate(of.items()):
        dash = DASHES[index // len(COLOURS) % len(DASHES)]
        axis.plot(
            claimed, 100.0 * observed, dash, color=COLOURS[index % len(COLOURS)], lw=1.3, label=plain(name)
        )
    axis.set(xlim=(0, 100), ylim=(0, 100), title=title, xlabel="claimed to hold the truth, %", aspect="equal")
    axis.set_xticks([0, 25, 50, 75, 95])
    axis.set_yticks([0, 25, 50, 75, 95])
    if of:
        axis.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), fontsize=7.5, frameon=False)


def draw(kept: dict[str, Any]) -> None:
    """Draw the calibration curves: scenarios, recordings, and the mean of all."""
    parts = {"simulated scenarios": curves(kept, "scenarios"), "recordings": curves(kept, "recordings")}
    everything = [observed for of in parts.values() for observed in of.values()]
    if not everything:
        return
    look = {
        "svg.hashsalt": "beliefd",
        "svg.fonttype": "none",
        "font.size": 9,
        "axes.spines.top": False,
        "axes.spines.right": False,
    }
    with mpl.rc_context({**look, "axes.grid": True, "grid.color": "#e6e6e6", "axes.axisbelow": True}):
        figure = Figure(figsize=(9.6, 6.2), layout="constrained")
        axes = figure.subplots(1, 3)
        for axis, (title, of) in zip(axes, parts.items(), strict=False):
            panel(axis, of, title)
        panel(axes[2], {f"mean of these {len(everything)}": np.mean(everything, axis=0)}, "all together")
        axes[0].set_ylabel("observed to hold it, %")
        # The legends lie below the axes, where the layout does not look: leave them room.
        figure.get_layout_engine().set(rect=(0.0, 0.16, 1.0, 0.8))
        text = StringIO()
        figure.savefig(text, format="svg", metadata={"Date": None})
    PICTURE.write_text(re.sub(r"(\d\.\d\d)\d+", r"\1", text.getvalue()), encoding="utf-8")


def percent(share: dict[str, float] | None) -> str:
    """Return a share over the seeds in percent; a dash where there is none."""
    return "–" if share is None else f"{100.0 * share['mean']:.1f} %"


def calibration(kept: dict[str, Any]) -> str:
    """Return the table of claimed and observed."""
    head = ("", "50 %", "95 %", "99 %", "NEES", "its bounds", "log score", "RMSE, m", "checks", "command")
    lines = [f"| {' | '.join(head)} |", f"|{'---|' * len(head)}"]
    every: list[np.ndarray] = []
    true: list[np.ndarray] = []
    for part in ("scenarios", "recordings"):
        for name, one in kept.get(part, {}).items():
            if not one["levels"]:
                continue
            observed = curve(one["levels"])
            every += [observed] if once(name) else []
            true += [observed] if counts(name) else []
            low, high = one["nees_bounds"]
            cells = (
                f"scenario `{name}`" if part == "scenarios" else name,
                *(f"{100.0 * observed[level]:.1f} %" for level in (50, 95, 99)),
                f"{one['nees_mean']['mean']:.2f}",
                f"{low:.2f} … {high:.2f}",
                f"{one['log_score']['mean']:.2f}",
                f"{one['rmse_m']['mean']:.3f}",
                passed(one),
                f"`{one['command']}`",
            )
            lines.append(f"| {' | '.join(cells)} |")
    lines += [mean_row(f"mean of the {len(true)} that count", true)] if true else []
    lines += (
        [mean_row(f"mean of {len(every)}, with those against a copy", every)]
        if len(every) > len(true)
        else []
    )
    return "\n".join(lines)


def mean_row(name: str, observed: list[np.ndarray]) -> str:
    """Return the line of the mean of some curves."""
    mean = np.mean(observed, axis=0)
    return f"| {name} | {' | '.join(f'{100.0 * mean[level]:.1f} %' for level in (50, 95, 99))} |{' |' * 6}"


def passed(one: dict[str, Any]) -> str:
    """Return how many of all checks of all seeds were passed; nothing where nothing is asked."""
    if not one["checks"]:
        return ""
    counts = np.sum(list(one["checks"].values()), axis=0)
    return f"{counts[0]} of {counts[1]}"


def ablation(kept: dict[str, Any]) -> str:
    """Return the table of what is left when one mechanism is switched off."""
    head = ("", "everything on", *(f"without {switch}" for switch in SWITCHES))
    lines = [f"| {' | '.join(head)} |", f"|{'---|' * len(head)}"]
    rows = [("scenarios", name) for name in SCENARIOS] + [("recordings", name) for name in TRACES]
    for whole, name in rows:
        parts = [kept.get(part, {}).get(name) for part in (whole, *(f"without {s}" for s in SWITCHES))]
        if any(one is not None for one in parts):
            shown = f"scenario `{name}`" if whole == "scenarios" else name
            lines.append(f"| {shown} | {' | '.join(worth(one) for one in parts)} |")
    return "\n".join(lines)


def worth(one: dict[str, Any] | None) -> str:
    """Return one cell: checks passed, RMSE and worst error, share inside 95 %."""
    if one is None or "rmse_m" not in one:
        return "–"
    figures = f"{metres(one['rmse_m']['mean'])}, {metres(one['max_m']['max'])}, {percent(one['coverage_95'])}"
    asked = passed(one)
    return f"**{asked}**; {figures}" if asked else figures


def metres(value: float) -> str:
    """Return metres with as many digits as they are worth."""
    return f"{value:.2f} m" if value < 10.0 else f"{value:.0f} m"


def questions(kept: dict[str, Any]) -> str:
    """Return the table of what each scenario asks, and how often it was so."""
    lines = ["| scenario | what it asks | seeds in which it was so |", "|---|---|---|"]
    for name, one in kept.get("scenarios", {}).items():
        lines += [f"| `{name}` | {check} | {was} of {of} |" for check, (was, of) in one["checks"].items()]
    return "\n".join(lines)


def write_page() -> None:
    """Write the tables into the page, and the picture beside it."""
    with measuring.alone():
        kept = measuring.everything()
        measuring.put(CALIBRATION, calibration(kept))
        measuring.put(CHECKS, questions(kept))
        measuring.put(ABLATION, ablation(kept))
        draw(kept)


def main() -> None:
    """Run as a program."""
    parser = argparse.ArgumentParser(
        description="Draw the calibration and write its tables into accuracy.md."
    )
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--only", default="", help="scenarios whose name holds this")
    parser.add_argument("--part", default="", help="parts whose name holds this: scenarios, without")
    parser.add_argument("--draw-only", action="store_true", help="measure nothing")
    options = parser.parse_args()
    if not options.draw_only:
        measure(options.seeds, options.only, options.part)
    write_page()


if __name__ == "__main__":
    main()
