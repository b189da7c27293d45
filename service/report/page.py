"""The page: a summary on top, then every figure with its key; all that it needs is in the file, so it opens offline."""

from __future__ import annotations

from datetime import UTC, datetime
from html import escape
from typing import Any

from service.replay.run import Plan, Run, counts
from service.replay.seeds import summary
from service.replay.table import FIGURES, figure
from service.report.library import embedded, program
from service.report.plots import Key, Plot, plots
from service.report.series import series_of
from service.report.style import STYLE

LABELS = {
    "rmse_m": "RMSE, m",
    "p95_m": "95 % below, m",
    "max_m": "worst, m",
    "coverage_95": "inside 95 %",
    "nees_mean": "NEES",
    "final_m": "at the end, m",
    "particles_mean": "particles",
}


def page(plan: Plan, runs: list[Run]) -> str:
    """Return the report of ``runs`` as HTML; the figures are of the run that was traced.

    Raises
    ------
    ValueError
        No run was traced.
    """
    traced = next((run for run in runs if run.trace is not None), None)
    if traced is None or traced.trace is None:
        raise ValueError("a report needs a run that was traced (Plan.traced)")
    series = series_of(traced.trace, plan.truth)
    drawn = plots(series)
    script, places = embedded({plot.name: plot.figure for plot in drawn})
    title = " and ".join(path.name for path in plan.logs)
    began = datetime.fromtimestamp(series.start, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
    duration = float(series.ticks["time"][-1])
    lead = f"{began}, {duration:.0f} s; figures of seed {traced.seed}, table over {_seeds(runs)}"
    sections = "\n".join(_section(plot, places[plot.name]) for plot in drawn)
    library = program()
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(title)} · beliefd replay</title>
<link rel="icon" href="data:,">
<style>{STYLE}</style>
{library}
</head>
<body>
<header><h1>{escape(title)}</h1><p>{escape(lead)}</p></header>
<main>
<section id="summary">{_table(runs)}{_details(traced)}</section>
{sections}
</main>
{script}
</body>
</html>
"""


def _seeds(runs: list[Run]) -> str:
    return "1 seed" if len(runs) == 1 else f"{len(runs)} seeds"


def _table(runs: list[Run]) -> str:
    """One row a figure, so that it is narrow: particle filter beside extended Kalman filter."""
    spread: dict[str, Any] = summary(runs)
    rows = [
        f"<tr><th>{escape(LABELS[name])}</th><td>{_spread(spread.get(name), form, len(runs))}</td>"
        f"<td>{_spread(spread['shadow'].get(name), form, len(runs))}</td></tr>"
        for name, _, form in FIGURES
        if name in spread or name in spread["shadow"]
    ]
    gated = spread["shadow"].get("gated")
    rows.append(
        f"<tr><th>kept out by the gate</th><td></td><td>{_spread(gated, '{:.0f}', len(runs))}</td></tr>"
    )
    return (
        "<table><thead><tr><th></th><th>particle filter</th><th>extended Kalman filter</th></tr></thead>"
        f"<tbody>{''.join(rows)}</tbody></table>"
    )


def _spread(values: dict[str, float] | None, form: str, seeds: int) -> str:
    if values is None:
        return "–"
    mean = figure(values["mean"], form)
    if seeds == 1:
        return mean
    return f"{mean} <small>± {figure(values['sd'], form)}, worst {figure(values['max'], form)}</small>"


def _details(run: Run) -> str:
    health = ", ".join(f"{state.replace('_', ' ')} {share:.1%}" for state, share in run.health.items())
    lines = [("health", health), ("speed", f"{run.real_time_factor:.0f} times real time")]
    for name, (value, sigma) in run.biases.items():
        lines.append((f"{name.replace('_', ' ')} at the end", f"{value:.5f} ± {sigma:.5f}"))
    for name, (accepted, refused) in run.sensors.items():
        lines.append((name, f"{accepted} used" + (f"; refused: {counts(refused)}" if refused else "")))
    items = "".join(f"<dt>{escape(what)}</dt><dd>{escape(said)}</dd>" for what, said in lines)
    return f"<dl>{items}</dl>"


def _section(plot: Plot, place: str) -> str:
    wide = " wide" if plot.name == "health" else ""
    return (
        f'<section class="plot{wide}" id="{escape(plot.name)}"><h2>{escape(plot.title)}</h2>'
        f"<p>{escape(plot.caption)}</p>{_keys(plot.keys)}{place}</section>"
    )


def _keys(keys: list[Key]) -> str:
    items = "".join(
        f'<li><i class="{key.shape}" style="--c:{key.colour}"></i>{escape(key.meaning)}</li>' for key in keys
    )
    return f'<ul class="key">{items}</ul>'
