"""``beliefd replay``: a recording through the same estimator, faster than real time."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.cli.failure import leave

NAME = "replay"
EPILOG = """
[bold]Examples[/bold]

beliefd replay flight.tlog --config robot.toml --out results/ [dim]· writes results/estimates_seed0.csv[/dim]

beliefd replay flight.tlog --report flight.html [dim]· track, error, innovations, health: one page[/dim]

beliefd replay car.log gnss.tlog --blank position:20-50 [dim]· how it coasts without fixes[/dim]

beliefd replay run.mcap [dim]· a run of beliefd run --record: the same again, to the byte[/dim]

beliefd replay plaza2.tlog --truth plaza2_truth.csv --seeds 20 --json
"""


def command(
    logs: Annotated[
        list[Path],
        typer.Argument(
            help="Recordings: .tlog, .bin, .ulg, candump .log(.gz), .asc, .blf, .trc, .mcap.",
            metavar="LOG…",
            exists=True,
            dir_okay=False,
        ),
    ],
    config: Annotated[
        Path | None,
        typer.Option(
            help="The configuration, or the site only; default: what a recorded run holds, or LOG's .toml beside it."
        ),
    ] = None,
    truth: Annotated[
        Path | None,
        typer.Option(
            help="CSV time_s,north_m,east_m,down_m,heading_rad to measure the error against.", exists=True
        ),
    ] = None,
    seeds: Annotated[int, typer.Option(help="How many runs, each with its own random numbers.", min=1)] = 1,
    out: Annotated[Path | None, typer.Option(help="Folder for estimates_seedN.csv.", file_okay=False)] = None,
    report: Annotated[
        Path | None,
        typer.Option(
            help="Write one self-contained page, of seed 0 (needs beliefd\\[view]).", dir_okay=False
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the figures as one JSON object.")] = False,
    particles: Annotated[
        int | None,
        typer.Option(help="Use exactly this many particles, whatever the budget.", min=10, max=10_000_000),
    ] = None,
    decisions: Annotated[
        Path | None,
        typer.Option(
            help="Give every tick what a recorded run gave it (beliefd run --decisions FILE).",
            metavar="FILE",
            exists=True,
            dir_okay=False,
        ),
    ] = None,
    blank: Annotated[
        list[str] | None,
        typer.Option(
            help="Take a sensor away for a time, by its kind or by who says it: position:20-50, GPS_RAW_INT:20-50 "
            "(seconds since the log's begin). May be repeated.",
            metavar="WHAT:FROM-TO",
        ),
    ] = None,
    without: Annotated[
        list[str] | None,
        typer.Option(
            help="A switch of \\[honesty] to turn off (trust, hypotheses, …, see docs); may be repeated."
        ),
    ] = None,
) -> None:
    """Replay recordings and print the error, the coverage and the health."""
    from service import kernels

    kernels.prepare()
    from service import replay

    leave(
        replay.command(
            logs, config, truth, seeds, out, report, as_json, particles, decisions, blank or (), without or ()
        )
    )
