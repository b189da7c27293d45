"""``beliefd send``: the queries, by hand."""

from __future__ import annotations

import os
import sys
from typing import Annotated

import typer

NAME = "send"
EPILOG = """
[bold]Examples[/bold]

beliefd send mower reinitialize --position 45.3,-34.2,0 --heading 0.45 [dim]· begin anew there[/dim]

beliefd send mower reinitialize --position 45.3,-34.2,0 --sigma 5,5,1 [dim]· about there, heading unknown[/dim]

beliefd send mower reinitialize mode=global [dim]· anywhere in the configuration's \\[area][/dim]

beliefd send mower reinitialize '{"position": \\[45.3, -34.2, 0], "heading": 0.45}' [dim]· the same[/dim]

beliefd send mower status [dim]· also: latest, config, schema[/dim]

beliefd send mower density extractor=kmeans [dim]· or gaussian, histogram, tree, kernel[/dim]

The answer is JSON on standard output. Exit status: 0 answered, 1 refused or nobody there, 2 wrong use.
"""


def command(
    vehicle: Annotated[str, typer.Argument(help="Name of the vehicle, as its configuration has it.")],
    request: Annotated[
        str,
        typer.Argument(
            help="reinitialize (begin anew), density, latest, status, config or schema.", metavar="QUERY"
        ),
    ],
    facts: Annotated[
        list[str] | None,
        typer.Argument(
            help="What it needs: NAME=VALUE as \\[start] has them, or one JSON object.", metavar="[FACT]..."
        ),
    ] = None,
    position: Annotated[
        str | None, typer.Option(help="Where: metres north, east and down of the origin.", metavar="N,E,D")
    ] = None,
    heading: Annotated[
        float | None, typer.Option(help="Radians clockwise from true north; without it: unknown.")
    ] = None,
    sigma: Annotated[
        str | None, typer.Option(help="Standard deviation of the position, metres.", metavar="N,E,D")
    ] = None,
    sigma_heading: Annotated[
        float | None, typer.Option(help="Standard deviation of the heading, radians.")
    ] = None,
    router: Annotated[
        str | None, typer.Option(help="Zenoh endpoint to connect to; default: the daemon on this machine.")
    ] = None,
    prefix: Annotated[str, typer.Option(help="As publish.prefix of the daemon.")] = "beliefd/v1",
    timeout: Annotated[float, typer.Option(help="Seconds to wait for the answer.", min=0.1)] = 5.0,
) -> None:
    """Ask a daemon for something: to begin anew where you say, its status, its density."""
    from service.cli.failure import WRONG_USE, say
    from service.view import send

    options = {"position": position, "sigma": sigma}
    numbers = {"heading": heading, "sigma_heading": sigma_heading}
    try:
        given = send.facts_of(facts or ())
        given |= {name: send.value_of(value) for name, value in options.items() if value is not None}
        given |= {name: value for name, value in numbers.items() if value is not None}
        status = send.run(vehicle, request, given, router, timeout, prefix)
    except send.WrongUseError as error:
        say(f"beliefd send: {error}")
        status = WRONG_USE
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)  # a thread of Zenoh that still receives would abort the interpreter's own way out
