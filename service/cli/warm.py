"""``beliefd warm``: compile the kernels ahead of the first start, and the modules where Python does not."""

from __future__ import annotations

from typing import Annotated

import typer

NAME = "warm"
EPILOG = (
    "make install and beliefd service install call it; the compiled kernels are kept in the user's cache."
)


Everything = Annotated[bool, typer.Option("--all", help="Also the kernels that the daemon does not run.")]


def command(everything: Everything = False) -> None:
    """Compile the daemon's kernels that are not in the cache yet."""
    import time

    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    from service import bytecode, kernels

    bytecode.keep()
    warm = kernels.warm_all if everything else kernels.warm
    started = time.monotonic()
    columns = (
        TextColumn("compiling"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.description}"),
    )
    console = Console()
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=None)
        folder = warm(
            lambda name, done, total: bar.update(task, description=name, completed=done, total=total)
        )
    console.print(
        f"kernels ready in {time.monotonic() - started:.1f} s: {folder}", soft_wrap=True, highlight=False
    )
