"""``beliefd scenario``: a simulated vehicle end to end through message bytes, many times."""

from __future__ import annotations

from typing import Annotated

import typer

from service.cli.failure import leave

NAME = "scenario"
EPILOG = """
[bold]Examples[/bold]

beliefd scenario [dim]· lists them[/dim]

beliefd scenario beacons --seeds 20

beliefd scenario spoof --seeds 5 --without trust
"""


def command(
    name: Annotated[str | None, typer.Argument(help="Which scenario; without it: list them.")] = None,
    seeds: Annotated[
        int, typer.Option(help="How many runs, each with its own vehicle and noise.", min=1)
    ] = 1,
    seconds: Annotated[
        float | None,
        typer.Option(
            help="How long each drive is.  [default: the scenario's own]", min=1.0, show_default=False
        ),
    ] = None,
    without: Annotated[
        list[str] | None,
        typer.Option(
            help="A switch of \\[honesty] to turn off (trust, hypotheses, …, see docs); may be repeated.",
            show_default=False,
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the figures as one JSON object.")] = False,
) -> None:
    """Simulate a scenario to message bytes, replay them, and measure the error against the truth."""
    from service import kernels

    kernels.prepare()
    from service import scenario

    leave(scenario.command(name, seeds, as_json, scenario.Play(seconds, tuple(without or ()))))
