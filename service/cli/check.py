"""``beliefd check``: what a configuration would run, or every error in it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

NAME = "check"
EPILOG = """
[bold]Example[/bold]

beliefd check robot.toml && beliefd run robot.toml

Exit status: 0 usable, 2 wrong, with every error at once and its place in the file.
"""


def command(
    configuration: Annotated[Path, typer.Argument(help="The configuration file (TOML).", metavar="CONFIG")],
) -> None:
    """Read a configuration and everything it names; print what would run."""
    from rich.console import Console

    from service.cli import plan
    from service.config import ConfigurationError, load
    from service.publish.session import SessionError, configuration_from_file

    read = load(configuration)
    if read.publish.zenoh:
        try:
            configuration_from_file(read.publish.zenoh)
        except SessionError as error:
            raise ConfigurationError([f"{configuration.name}: {error}"]) from error
    console = Console(highlight=False)
    for table in plan.tables(read):
        console.print(table)
    for note in plan.notes(read):
        console.print(f"note: {note}", soft_wrap=True, markup=False)
    console.print(f"{configuration.name}: usable", markup=False)
