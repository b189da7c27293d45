"""``beliefd service``: the systemd unit, its user, its directories."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.cli.failure import CommandError, leave, say

_EPILOG = """
[bold]Examples[/bold]

sudo beliefd service install robot.toml

beliefd service status

sudo beliefd service uninstall --purge
"""

application = typer.Typer(
    help="Install the daemon as a systemd service, look at it, remove it.",
    epilog=_EPILOG,
    no_args_is_help=True,
    rich_markup_mode="rich",
)

_Name = Annotated[
    str | None, typer.Option("--name", help="One of several services on this machine: beliefd-NAME.service.")
]


@application.command()
def install(
    configuration: Annotated[
        Path, typer.Argument(help="The configuration file; a copy goes to /etc/beliefd.", metavar="CONFIG")
    ],
    name: _Name = None,
    no_start: Annotated[bool, typer.Option("--no-start", help="Neither start it nor enable it.")] = False,
) -> None:
    """Make the user and the directories, compile the kernels, write the unit, start it."""
    from service import install as room

    try:
        names = room.install(configuration, name, say)
        if not no_start:
            room.start(names)
            say(f"{names.service} is ready")
    except room.InstallError as error:
        raise CommandError(str(error)) from error
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error


@application.command()
def status(name: _Name = None) -> None:
    """Show the unit and what the daemon says of itself; exit 1 when it does not run."""
    from service import install as room
    from service.install import standing

    try:
        leave(standing.show(name))
    except room.InstallError as error:
        raise CommandError(str(error)) from error
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error


@application.command()
def uninstall(
    name: _Name = None,
    remove_all: Annotated[
        bool, typer.Option("--purge", help="Remove configuration, state and user too.")
    ] = False,
) -> None:
    """Stop the service and remove its unit."""
    from service import install as room

    try:
        names = room.uninstall(name, say)
        if remove_all:
            room.purge(names, say)
    except room.InstallError as error:
        raise CommandError(str(error)) from error
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error
