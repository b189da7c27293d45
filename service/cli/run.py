"""``beliefd run``: the daemon in the foreground."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.cli.failure import leave

NAME = "run"
EPILOG = """
[bold]Examples[/bold]

beliefd run robot.toml

kill -HUP [dim]PID · read the file again, or keep the old one and say why not[/dim]

kill -TERM [dim]PID · stop within two seconds, exit 0[/dim]
"""


def command(
    configuration: Annotated[Path, typer.Argument(help="The configuration file (TOML).", metavar="CONFIG")],
) -> None:
    """Run the daemon in the foreground until SIGTERM."""
    from service import kernels
    from service.config import load

    load(configuration)  # every error at once, before a process is started
    kernels.prepare()
    from service import supervisor

    leave(supervisor.run(configuration))
