"""``beliefd demo``: the whole chain on this machine, live in the terminal."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.cli.failure import leave

NAME = "demo"
EPILOG = """
[bold]Examples[/bold]

beliefd demo [dim]· one minute, then the error against the truth[/dim]

beliefd demo --seconds 20
"""


def command(
    seconds: Annotated[float, typer.Option(help="How long to drive.", min=5.0, max=86_400.0)] = 60.0,
    scenario: Annotated[
        str, typer.Option(help="Which course and sensors; beliefd scenario lists them.")
    ] = "demo",
    picture: Annotated[
        Path | None,
        typer.Option(help="Write the live view as it was at the end there, as SVG.", show_default=False),
    ] = None,
) -> None:
    """Drive a simulated rover over MAVLink and CAN, run the daemon, show its belief."""
    from service import kernels

    kernels.prepare()
    from service.view import demo

    leave(demo.run(seconds, scenario, picture))
