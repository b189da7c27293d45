"""``beliefd replay``: logs through the estimator, told as a table or as JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

from rich.console import Console

from service.decisions import DecisionLogError
from service.decisions import read as read_decisions
from service.replay.bars import run_with_bars
from service.replay.blanking import Blank
from service.replay.recorded import RecordedRunError
from service.replay.run import Plan, Run
from service.replay.seeds import summary
from service.replay.site import setting_of
from service.replay.sources import LogError
from service.replay.table import show
from service.score import read_truth
from service.switches import switched_off, unknown_switches

PARTICLES = 5000
"""How many particles a replay affords where the command does not say."""


class ReportError(Exception):
    """No report can be made; the text says why, and what would help."""


def plan_of(
    logs: tuple[Path, ...],
    config: Path | None,
    truth: Path | None,
    out: Path | None,
    particles: int | None,
    console: Console,
    blanks: tuple[Blank, ...] = (),
) -> Plan:
    """Return how to replay ``logs``; what was filled in is told on ``console``.

    Raises
    ------
    ConfigurationError, LogError, RecordedRunError, ValueError
        What the files have wrong, in the user's words.
    """
    setting = setting_of(logs, config, truth)
    for note in setting.notes:
        console.print(f"[dim]{note}[/dim]", highlight=False)
    for blank in blanks:
        console.print(f"[dim]{blank.words}[/dim]", highlight=False)
    known = read_truth(setting.truth) if setting.truth is not None else None
    again = setting.recorded if len(logs) == 1 and particles is None else None
    if again is not None:
        said = f" (the longest of {again.of})" if again.of > 1 else ""
        console.print(f"[dim]decisions: of that run, {again.ticks} ticks{said}[/dim]", highlight=False)
    return Plan(
        logs, setting.configuration, particles or PARTICLES, known, out, blanks=blanks, recorded=again
    )


def write_report(path: Path, plan: Plan, runs: list[Run]) -> None:
    """Write the page of the run that was traced."""
    from service import report

    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(report.page(plan, runs), encoding="utf-8")


def require_report() -> None:
    """Find out before the replay whether its report can be drawn.

    Raises
    ------
    ReportError
        The plotting library is not installed.
    """
    if find_spec("bokeh") is None:
        raise ReportError("--report needs bokeh: pip install 'beliefd[view]'")


def as_json(runs: list[Run]) -> str:
    """Return the runs and their summary as the object that ``--json`` prints."""
    return json.dumps({"runs": [run.row() for run in runs], "summary": summary(runs)})


def command(
    logs: list[Path],
    config: Path | None,
    truth: Path | None,
    seeds: int,
    out: Path | None,
    report: Path | None,
    as_json_object: bool,
    particles: int | None,
    decisions: Path | None = None,
    blank: Sequence[str] = (),
    without: Sequence[str] = (),
) -> int:
    """Run ``beliefd replay`` and return its exit status: 0 done, 1 a log could not be replayed, 2 not understood."""
    console = Console(stderr=as_json_object)
    if wrong := unknown_switches(tuple(without)):
        console.print(wrong, highlight=False, markup=False, style="red")
        return 2
    try:
        if report is not None:
            require_report()
        blanks = tuple(Blank.of(text) for text in blank)
        plan = plan_of(tuple(logs), config, truth, out, particles, console, blanks)
        plan = replace(plan, configuration=switched_off(plan.configuration, tuple(without)))
        if decisions is not None:
            plan = replace(plan, decisions=tuple(read_decisions(decisions)), recorded=None)
        runs = run_with_bars(replace(plan, traced=None if report is None else 0), list(range(seeds)), console)
        if blank and not any(run.blanked for run in runs):
            console.print("--blank: there was no such sample in that time", style="yellow", highlight=False)
        if report is not None:
            write_report(report, plan, runs)
    except (LogError, RecordedRunError, ReportError, DecisionLogError, ValueError, OSError) as error:
        console.print(str(error), style="red", markup=False, highlight=False)
        return 1
    if as_json_object:
        print(as_json(runs))  # noqa: T201  the command's result
    else:
        show(runs, console, ", ".join(path.name for path in logs))
        if out is not None:
            console.print(f"  estimates: {out}/estimates_seed*.csv", highlight=False)
    if report is not None:
        console.print(f"  report: {report}", highlight=False)
    return 0
