"""``beliefd bench``: what this machine affords."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.cli.failure import leave

NAME = "bench"
EPILOG = """
[bold]Examples[/bold]

beliefd bench

beliefd bench --config robot.toml --rates 50,100,200 --plot cost.svg
"""


def _rates(text: str) -> list[float]:
    try:
        rates = [float(word) for word in text.split(",")]
    except ValueError as error:
        raise typer.BadParameter(f"numbers with commas between them, got {text!r}") from error
    if not all(1.0 <= rate <= 1000.0 for rate in rates):
        raise typer.BadParameter(f"each from 1 to 1000 ticks per second, got {text!r}")
    return rates


def command(
    config: Annotated[
        Path | None,
        typer.Option(help="Whose sensors and motion; default: a rover with four beacons.", metavar="CONFIG"),
    ] = None,
    rates: Annotated[str, typer.Option(help="Ticks per second.", metavar="HZ,HZ,…")] = "20,50,100,200",
    share: Annotated[
        float, typer.Option(help="Of a processor, what the loop may use.", min=0.01, max=1.0)
    ] = 0.4,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    plot: Annotated[
        Path | None, typer.Option(help="Draw cost against count (.svg, .png).", dir_okay=False)
    ] = None,
) -> None:
    """Measure what a tick costs here, and how many particles fit into the budget at each rate."""
    wanted = _rates(rates)
    from service import kernels

    kernels.prepare()
    from service import bench

    leave(bench.command(config, wanted, share, as_json, plot))
