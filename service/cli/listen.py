"""``beliefd listen``: a Zenoh subscriber in the terminal."""

from __future__ import annotations

from typing import Annotated

import typer

from service.cli.failure import leave

NAME = "listen"
EPILOG = """
[bold]Examples[/bold]

beliefd listen [dim]· the vehicle that is live on this machine[/dim]

beliefd listen mower

beliefd listen mower --router tcp/192.168.1.7:7447
"""


def command(
    vehicle: Annotated[
        str | None, typer.Argument(help="Name of the vehicle; without it: the only one that is live.")
    ] = None,
    router: Annotated[
        str | None, typer.Option(help="Zenoh endpoint to connect to; default: the daemon on this machine.")
    ] = None,
) -> None:
    """Show what a daemon publishes."""
    from service.view import listen

    leave(listen.run(vehicle, router))
