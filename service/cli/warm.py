"""``beliefd warm``: compile the kernels ahead of the first start."""

from __future__ import annotations

NAME = "warm"
EPILOG = (
    "make install and beliefd service install call it; the compiled kernels are kept in the user's cache."
)


def command() -> None:
    """Compile the kernels that are not in the cache yet."""
    import time

    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    from service import kernels

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
        folder = kernels.warm(
            lambda name, done, total: bar.update(task, description=name, completed=done, total=total)
        )
    console.print(
        f"kernels ready in {time.monotonic() - started:.1f} s: {folder}", soft_wrap=True, highlight=False
    )
