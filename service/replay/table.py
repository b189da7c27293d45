"""A replay's runs as a table: a row a seed, the spread over the seeds, and the shadow Kalman filter below."""

from __future__ import annotations

from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from service.replay.bars import speed_in_words
from service.replay.run import Run, counts
from service.replay.seeds import summary

FIGURES = (
    ("rmse_m", "RMSE m", "{:.3f}"),
    ("p95_m", "95 % m", "{:.3f}"),
    ("max_m", "worst m", "{:.3f}"),
    ("coverage_95", "in 95 %", "{:.1%}"),
    ("nees_mean", "NEES", "{:.2f}"),
    ("final_m", "end m", "{:.3f}"),
    ("particles_mean", "count", "{:.0f}"),
)
SHOWN = 10
"""Seeds whose figures stand beside a check."""

SHADOW = "EKF"
"""What the extended Kalman filter's rows are called."""


def show(runs: list[Run], console: Console, title: str) -> None:
    """Print a table of the runs, what became of the samples, and the spread over the seeds."""
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1))
    table.add_column("seed", justify="right", no_wrap=True)
    for _, heading, _ in FIGURES:
        table.add_column(heading, justify="right")
    table.add_column("speed", justify="right")
    for run in runs:
        table.add_row(str(run.seed), *_cells(run.row()), f"x{run.real_time_factor:.0f}")
    spread: dict[str, Any] = summary(runs)
    statistics = ("mean", "sd", "max") if len(runs) > 1 else ()
    if statistics:
        table.add_section()
    for statistic in statistics:
        table.add_row(statistic, *_cells(_column(spread, statistic)), "")
    table.add_section()
    for statistic in statistics or ("mean",):
        name = SHADOW if statistic == "mean" else f"{SHADOW} {statistic}"
        table.add_row(name, *_cells(_column(spread["shadow"], statistic)), "", style="dim")
    console.print(table)
    health: dict[str, float] = spread["health"]
    shares = ", ".join(f"{state} {share:.1%}" for state, share in health.items())
    since = spread.get("tracked_after_s")
    settled = (
        "" if since is None else f"; tracking after {since['mean']:.1f} s, the last seed {since['max']:.1f} s"
    )
    console.print(f"  health: {shares}{settled}", highlight=False)
    slowest = min(run.real_time_factor for run in runs)
    console.print(f"  the slowest run: {speed_in_words(slowest)}", highlight=False)
    for name, key in (("", "outages"), (f"{SHADOW}: ", "shadow_outages")):
        for fared in spread[key]:
            console.print(f"  {name}{_outage(fared)}", highlight=False)
    _show_details(runs[0], console)
    _show_shadow(runs[0], console)


def show_checks(runs: list[Run], console: Console) -> None:
    """Print the questions that a scenario asks: passed by how many runs, and the figures of the first ten seeds."""
    if not runs[0].checks:
        return
    table = Table(box=SIMPLE_HEAD, padding=(0, 1))
    for heading in ("check", "passed", "found, seed by seed"):
        table.add_column(heading)
    for index, check in enumerate(runs[0].checks):
        given = [run.checks[index] for run in runs]
        passed = sum(one.passed for one in given)
        found = "  ".join(figure(one.found, "{:.4g}") for one in given[:SHOWN])
        style = "" if passed == len(given) else "red"
        table.add_row(check.name, f"{passed} of {len(given)}", found, style=style)
    console.print(table)


def figure(value: Any, form: str) -> str:
    """Return a figure in its form, and a dash where there is none."""
    return "–" if value is None else form.format(value)


def _cells(row: dict[str, Any]) -> list[str]:
    return [figure(row.get(name), form) for name, _, form in FIGURES]


def _column(spread: dict[str, Any], statistic: str) -> dict[str, Any]:
    return {name: spread.get(name, {}).get(statistic) for name, _, _ in FIGURES}


def _outage(fared: dict[str, Any]) -> str:
    """Say how a blanking ended, the mean over the seeds and the worst."""
    error, radius, distance = (fared[name]["mean"] for name in ("error_m", "radius_m", "distance_m"))
    share = f", {fared['share']['mean']:.2%} of {distance:.0f} m" if "share" in fared else ""
    return (
        f"{fared['what']}: at its end {error:.2f} m off{share}; the worst {fared['error_m']['max']:.2f} m; "
        f"95 % within {radius:.1f} m; {fared['coverage_95']['mean']:.1%} inside meanwhile"
    )


def _show_details(run: Run, console: Console) -> None:
    for name, (value, sigma) in run.biases.items():
        console.print(f"  {name} at the end: {value:.5f} ± {sigma:.5f}", highlight=False)
    for name, (accepted, refused) in run.sensors.items():
        console.print(
            f"  {name}: {accepted} used" + (f"; refused: {counts(refused)}" if refused else ""),
            highlight=False,
        )
    for link in run.links:
        console.print(
            f'  link "{link.link}": {link.messages} messages, {link.samples} samples'
            + (f"; lost on the way: {link.lost}" if link.lost else "")
            + (f"; malformed: {counts(link.malformed)}" if link.malformed else "")
            + (f"; not usable: {counts(link.unusable)}" if link.unusable else ""),
            highlight=False,
        )
    if run.again is not None:
        console.print(f"  {run.again.words}", highlight=False)
    if run.score.rmse_m is None:
        console.print("  no truth to compare with (--truth CSV)", highlight=False)
    if run.last_reason:
        console.print(f"  at the end: {run.last_reason}", highlight=False)


def _show_shadow(run: Run, console: Console) -> None:
    """Say what the extended Kalman filter left out, in one line."""
    shadow = run.shadow
    if not shadow.ticks:
        said = "never began: the heading was never known well enough"
    else:
        gated = f"gated: {counts(shadow.gated)}" if shadow.gated else "nothing gated"
        said = f"{sum(shadow.accepted.values())} used; {gated}"
    if shadow.unsupported:
        said += f"; it has no model for {counts(shadow.unsupported)}"
    if shadow.failure:
        said += f"; it stopped: {shadow.failure}"
    console.print(f"  {SHADOW} (extended Kalman filter, same samples): {said}", highlight=False)
