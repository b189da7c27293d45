"""``beliefd run``: the daemon in the foreground."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from service.cli.failure import CommandError, leave

NAME = "run"
EPILOG = """
[bold]Examples[/bold]

beliefd run robot.toml

beliefd run robot.toml --record run.mcap [dim]· samples, estimates and decisions: beliefd replay run.mcap[/dim]

beliefd run robot.toml --decisions run.csv [dim]· what every tick was allowed, for a replay[/dim]

kill -HUP [dim]PID · read the file again, or keep the old one and say why not[/dim]

kill -TERM [dim]PID · stop within two seconds, exit 0[/dim]
"""


def command(
    configuration: Annotated[Path, typer.Argument(help="The configuration file (TOML).", metavar="CONFIG")],
    record: Annotated[
        Path | None,
        typer.Option(
            help="Record the run (.mcap): all that beliefd replay needs to do it again. Needs beliefd\\[record].",
            metavar="FILE.mcap",
            dir_okay=False,
        ),
    ] = None,
    decisions: Annotated[
        Path | None,
        typer.Option(help="Write a decision log (CSV): count, level and cut of every tick.", metavar="FILE"),
    ] = None,
) -> None:
    """Run the daemon in the foreground until SIGTERM."""
    from service import kernels
    from service.config import load

    load(configuration)  # every error at once, before a process is started
    _begin_recording(record)
    _begin(decisions)
    kernels.prepare()
    from service import supervisor

    leave(supervisor.run(configuration, decisions, record))


def _begin_recording(path: Path | None) -> None:
    """Make an empty file, which the recording process then fills; what was recorded once is not written over."""
    if path is None:
        return
    if find_spec("mcap") is None:
        raise CommandError("--record needs mcap: pip install 'beliefd[record]'")
    try:
        path.open("xb").close()
    except FileExistsError as error:
        raise CommandError(
            f"--record: {path} exists already, and is not written over: name another file, or move it away"
        ) from error
    except OSError as error:
        raise CommandError(f"--record: {path}: cannot be written: {error.strerror}") from error


def _begin(decisions: Path | None) -> None:
    """Empty the decision log, which the recording process then writes at the end of."""
    if decisions is None:
        return
    try:
        decisions.write_text("")
    except OSError as error:
        raise CommandError(f"{decisions}: cannot be written: {error.strerror}") from error
