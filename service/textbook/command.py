"""``beliefd textbook``: compute exhibits one after the other, print their numbers, write their pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table as RichTable

from service.textbook import catalogue
from service.textbook.exhibit import Table


def show_list(console: Console) -> None:
    """Print every exhibit's name and title."""
    table = RichTable(box=SIMPLE_HEAD, padding=(0, 1))
    table.add_column("name", no_wrap=True)
    table.add_column("what it shows")
    for name, entry in catalogue.CATALOGUE.items():
        table.add_row(name, entry.title)
    console.print(table)


def run(names: Sequence[str], folder: Path, console: Console) -> None:
    """Make the named exhibits, and write each picture to ``folder`` as ``<name>.svg``.

    Raises
    ------
    OSError
        The folder cannot be made or written to.
    """
    from service.textbook import style

    folder.mkdir(parents=True, exist_ok=True)
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True) as progress, style.styled():
        task = progress.add_task("", total=len(names))
        for name in names:
            progress.update(task, description=name)
            exhibit = catalogue.make(name)
            path = folder / f"{name}.svg"
            style.save(exhibit.picture, path)
            _print(console, name, exhibit.tables, path)
            progress.advance(task)


def _print(console: Console, name: str, tables: Sequence[Table], path: Path) -> None:
    console.print(f"{name} · {catalogue.CATALOGUE[name].title}", style="bold", markup=False, highlight=False)
    for told in tables:
        table = RichTable(title=told.title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1))
        for place, column in enumerate(told.columns):
            table.add_column(column, justify="left" if place == 0 else "right", no_wrap=place == 0)
        for row in told.rows:
            table.add_row(*row)
        console.print(table, markup=False)
    console.print(f"  {path}\n", markup=False, highlight=False, soft_wrap=True)
