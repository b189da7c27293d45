"""``beliefd listen``: a Zenoh subscriber in the terminal."""

from __future__ import annotations

import os
import sys
from typing import Annotated

import typer

from service.cli.failure import DONE

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

    try:
        status = listen.run(vehicle, router)
    except KeyboardInterrupt:
        status = DONE
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)  # a thread of Zenoh that still receives would abort the interpreter's own way out
