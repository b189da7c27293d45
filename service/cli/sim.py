"""``beliefd sim``: the simulated vehicle alone, in a process of its own as any vehicle is."""

from __future__ import annotations

import subprocess
import sys
from typing import Annotated

import typer

from service.cli.failure import leave

NAME = "sim"
EPILOG = """
[bold]Examples[/bold]

beliefd sim beacons --mavlink udpout:127.0.0.1:14550 --can vcan0 --realtime

beliefd sim beacons --write out/beacons [dim]· out/beacons.tlog and its truth, faster than real time[/dim]

--mavlink URL [dim]· where its telemetry goes[/dim]   --can CHANNEL [dim]· where its bus is[/dim]

--realtime [dim]· at the pace of the clock[/dim], or --write STEM [dim]· into logs, with their truth[/dim]

Every option after SCENARIO is the simulator's own; all of them: python -m sim_vehicle --help
"""
SETTINGS = {"allow_extra_args": True, "ignore_unknown_options": True}


def command(
    context: typer.Context,
    scenario: Annotated[str, typer.Argument(help="Which scenario; beliefd scenario lists them.")],
) -> None:
    """Drive the simulated vehicle: MAVLink and CAN frames out, or files."""
    leave(
        subprocess.run([sys.executable, "-m", "sim_vehicle", scenario, *context.args], check=False).returncode
    )
