"""What every exercise and figure comes to: tables of numbers, and a picture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Table(NamedTuple):
    """Numbers in words.

    Attributes
    ----------
    title : str
    columns : tuple of str
        With units.
    rows : sequence of tuples of str
        As long as the columns.
    """

    title: str
    columns: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]


@dataclass(frozen=True)
class Exhibit:
    """One exercise or figure, made.

    Attributes
    ----------
    tables : tuple of Table
    picture : Figure
        Every axis labelled.
    """

    tables: tuple[Table, ...]
    picture: Figure


Make = Callable[[], Exhibit]


def number(value: float, digits: int = 4) -> str:
    """Write a number with as many significant digits, or as an exponent where it is far from one."""
    return f"{value:.{digits}g}"


def vector(values: Sequence[float], digits: int = 4) -> str:
    """Write a few numbers in parentheses."""
    return f"({', '.join(number(value, digits) for value in values)})"
