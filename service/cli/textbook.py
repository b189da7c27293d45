"""``beliefd textbook``: the exercises and figures of the book's chapter on these filters, by the filters themselves."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from service.cli.failure import CommandError

NAME = "textbook"
EPILOG = """
[bold]Examples[/bold]

beliefd textbook --list [dim]· what there is[/dim]

beliefd textbook exercise-1 exercise-4 [dim]· the car, by histogram and by particles[/dim]

beliefd textbook figure-4.7 --out pictures

beliefd textbook [dim]· all of them, in about a minute[/dim]

Chapter 4 of Probabilistic Robotics (Thrun, Burgard, Fox); docs/filters/textbook.md tells what to see.
Pictures need matplotlib: pip install 'beliefd\\[textbook]'.
"""


def command(
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="EXERCISE|FIGURE", help="Which; all of them if none is named."),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the pictures, SVG.", metavar="DIR")] = Path(
        "textbook"
    ),
    listing: Annotated[bool, typer.Option("--list", help="List them, and do nothing else.")] = False,
) -> None:
    """Compute and draw the exercises and figures of the textbook's chapter on these filters."""
    from rich.console import Console

    from service.textbook import catalogue
    from service.textbook import command as room

    console = Console(highlight=False)
    if listing:
        room.show_list(console)
        return
    wanted = list(dict.fromkeys(names or catalogue.CATALOGUE))
    unknown = [name for name in wanted if name not in catalogue.CATALOGUE]
    if unknown:
        raise typer.BadParameter(
            f"there is no {', '.join(unknown)}; beliefd textbook --list names what there is"
        )
    if find_spec("matplotlib") is None:
        raise CommandError(
            "beliefd textbook draws with matplotlib, which is not installed: pip install 'beliefd[textbook]'"
        )
    from service import kernels

    kernels.prepare()
    try:
        room.run(wanted, out, console)
    except OSError as error:
        raise CommandError(f"the pictures cannot be written to {out}: {error.strerror or error}") from error
