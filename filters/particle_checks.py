"""What a particle filter refuses, and what it says then."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

POSE = ("north", "east", "heading")


def check_shape(names: tuple[str, ...], capacity: int, block: int) -> None:
    """Check what a filter is made of.

    Raises
    ------
    ValueError
        A capacity or block below 1, a name that occurs twice, or columns that do not start with the pose.
    """
    if capacity < 1 or block < 1:
        raise ValueError(
            f"particle filter: capacity and block must be at least 1, got {capacity} and {block}"
        )
    if names[:3] != POSE:
        raise ValueError(
            f"particle filter: the first columns must be {', '.join(POSE)}, got {', '.join(names)}"
        )
    if len(set(names)) < len(names):
        raise ValueError(f"particle filter: a name occurs twice among {', '.join(names)}")


def check_start(columns: Mapping[str, NDArray[Any]], names: tuple[str, ...], capacity: int) -> int:
    """Check the columns that a belief starts from; return their length.

    Raises
    ------
    ValueError
        A dimension missing or unknown, or what :func:`check_columns` refuses.
    """
    if set(columns) != set(names):
        raise ValueError(
            f"initialize: columns must be {', '.join(names)}; missing {sorted(set(names) - set(columns))}, "
            f"unknown {sorted(set(columns) - set(names))}"
        )
    return check_columns("initialize", columns, capacity)


def check_injected(columns: Mapping[str, NDArray[Any]], names: tuple[str, ...], count: int) -> int:
    """Check the columns that take particles' places; return their length.

    Raises
    ------
    ValueError
        No dimension or an unknown one, or what :func:`check_columns` refuses.
    """
    if not columns or not set(columns) <= set(names):
        raise ValueError(
            f"inject: columns must be some of {', '.join(names)}, got {', '.join(columns) or 'none'}"
        )
    return check_columns("inject", columns, count)


def check_slow(names: Sequence[str], marginalised: Collection[str]) -> None:
    """Check which columns a kernel may spread.

    Raises
    ------
    ValueError
        No names or one twice, one of the pose, or one that is marginalised.
    """
    if not names or len(set(names)) < len(names):
        raise ValueError(
            f"regularize: slow states must be named, each once, got {', '.join(names) or 'none'}"
        )
    for name in names:
        if name in POSE:
            raise ValueError(
                f"regularize: {name} belongs to the pose, which its motion spreads; name slow states"
            )
        if name in marginalised:
            raise ValueError(f"regularize: {name} is marginalised; what is open of it is not in its column")


def check_columns(where: str, columns: Mapping[str, NDArray[Any]], most: int) -> int:
    """Check that columns are alike and finite; return their length.

    Raises
    ------
    ValueError
        Lengths that differ, a length of 0 or above ``most``, or a value that is not finite.
    """
    shapes = {name: column.shape for name, column in columns.items()}
    first = next(iter(shapes.values()))
    count = first[0] if len(first) == 1 else 0
    if set(shapes.values()) != {(count,)}:
        raise ValueError(f"{where}: columns must be one-dimensional and of one length, got {shapes}")
    if not 1 <= count <= most:
        raise ValueError(f"{where}: there can be 1 to {most} particles, got {count}")
    for name, column in columns.items():
        if not np.isfinite(column).all():
            raise ValueError(
                f"{where}: column {name} has {np.sum(~np.isfinite(column))} values that are not finite"
            )
    return count
