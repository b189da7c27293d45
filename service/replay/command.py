"""``beliefd replay``: logs through the estimator, told as a table or as JSON."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from service.replay.run import Plan, Run, counts
from service.replay.seeds import replay_seeds, summary
from service.replay.site import setting_of
from service.replay.sources import LogError
from service.score import read_truth

PARTICLES = 5000
"""How many particles a replay affords where the command does not say."""

FIGURES = (
    ("rmse_m", "RMSE m", "{:.3f}"),
    ("p95_m", "95 % m", "{:.3f}"),
    ("max_m", "worst m", "{:.3f}"),
    ("coverage_95", "in 95 %", "{:.1%}"),
    ("nees_mean", "NEES", "{:.2f}"),
    ("final_m", "end m", "{:.3f}"),
    ("particles_mean", "count", "{:.0f}"),
)


def replay_logs(
    logs: tuple[Path, ...],
    config: Path | None,
    truth: Path | None,
    seeds: int,
    out: Path | None,
    particles: int,
    console: Console,
) -> list[Run]:
    """Replay ``logs`` with seeds 0 … ``seeds`` - 1 and a progress bar on ``console``.

    Raises
    ------
    ConfigurationError, LogError, ValueError
        What the files have wrong, in the user's words.
    """
    setting = setting_of(logs, config, truth)
    for note in setting.notes:
        console.print(f"[dim]{note}[/dim]", highlight=False)
    known = read_truth(setting.truth) if setting.truth is not None else None
    plan = Plan(logs, setting.configuration, particles, known, out)
    return run_with_bars(plan, list(range(seeds)), console)


def run_with_bars(plan: Plan, seeds: list[int], console: Console) -> list[Run]:
    """Run ``plan`` for ``seeds``, with one bar over all of them."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(", ".join(path.name for path in plan.logs), total=float(len(seeds)))
        shares: dict[int, float] = {}

        def report(seed: int, share: float) -> None:
            shares[seed] = share
            progress.update(task, completed=sum(shares.values()))

        return replay_seeds(plan, seeds, report)


def as_json(runs: list[Run]) -> str:
    """Return the runs and their summary as the object that ``--json`` prints."""
    return json.dumps({"runs": [run.row() for run in runs], "summary": summary(runs)})


def show(runs: list[Run], console: Console, title: str) -> None:
    """Print a table of the runs, what became of the samples, and the spread over the seeds."""
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1))
    table.add_column("seed", justify="right")
    for _, heading, _ in FIGURES:
        table.add_column(heading, justify="right")
    table.add_column("speed", justify="right")
    for run in runs:
        row = run.row()
        cells = [_figure(row.get(name), form) for name, _, form in FIGURES]
        table.add_row(str(run.seed), *cells, f"x{run.real_time_factor:.0f}")
    spread: dict[str, Any] = summary(runs)
    if len(runs) > 1:
        table.add_section()
        for statistic in ("mean", "sd", "max"):
            cells = [_figure(spread.get(name, {}).get(statistic), form) for name, _, form in FIGURES]
            table.add_row(statistic, *cells, "")
    console.print(table)
    health: dict[str, float] = spread["health"]
    shares = ", ".join(f"{state} {share:.1%}" for state, share in health.items())
    console.print(f"  health: {shares}", highlight=False)
    _show_details(runs[0], console)


def _figure(value: Any, form: str) -> str:
    return "–" if value is None else form.format(value)


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
    if run.score.rmse_m is None:
        console.print("  no truth to compare with (--truth CSV)", highlight=False)
    if run.last_reason:
        console.print(f"  at the end: {run.last_reason}", highlight=False)


def command(
    logs: list[Path],
    config: Path | None,
    truth: Path | None,
    seeds: int,
    out: Path | None,
    as_json_object: bool,
    particles: int | None,
) -> int:
    """Run ``beliefd replay`` and return its exit status: 0 done, 1 a log could not be replayed."""
    console = Console(stderr=as_json_object)
    try:
        runs = replay_logs(tuple(logs), config, truth, seeds, out, particles or PARTICLES, console)
    except (LogError, ValueError, OSError) as error:
        console.print(f"[red]{error}[/red]", highlight=False)
        return 1
    if as_json_object:
        print(as_json(runs))  # noqa: T201  the command's result
    else:
        show(runs, console, ", ".join(path.name for path in logs))
        if out is not None:
            console.print(f"  estimates: {out}/estimates_seed*.csv", highlight=False)
    return 0
