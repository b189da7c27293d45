"""Rays through a grid, cell by cell (Amanatides and Woo, "A Fast Voxel Traversal Algorithm", 1987).

Coordinates are in cells: a ray starts at (row, column), real numbers, and runs along a unit vector, so that
lengths are in cells too. Where it leaves a cell is computed from the cell, not summed up on the way: no error
grows along the ray. A cell counts if the ray runs through it for more than a point; one that is only touched
at a corner does not. Rays may start outside the grid.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from filters.kernels.compile import function, kernel

Float64Array = NDArray[np.float64]
ByteArray = NDArray[np.uint8]

FREE, HIT = np.uint8(1), np.uint8(2)
"""Marks of a cell that a ray passed, and of one in which a ray ended; 0 is one that was not seen."""


@function
def _entry(origin: float, direction: float, size: int) -> float:
    """Length at which a ray enters the slab from 0 to ``size``; infinity if it never does."""
    if origin < 0.0:
        return -origin / direction if direction > 0.0 else math.inf
    if origin > size:
        return (size - origin) / direction if direction < 0.0 else math.inf
    return 0.0


@function
def _exit(cell: int, origin: float, direction: float) -> float:
    """Length at which a ray leaves a row (or column) of cells."""
    if direction > 0.0:
        return (cell + 1 - origin) / direction
    if direction < 0.0:
        return (cell - origin) / direction
    return math.inf


@function
def _cell(position: float, size: int) -> int:
    """Cell of a position in the grid; one on the far edge belongs to the last."""
    return max(0, min(size - 1, math.floor(position)))


@kernel("void(uint8[:, ::1], float64, float64, float64[:, ::1], float64[::1], float64[::1])", exact=True)
def mark(
    marks: ByteArray,
    row_origin: float,
    column_origin: float,
    directions: Float64Array,
    free: Float64Array,
    hit: Float64Array,
) -> None:
    """Mark the cells of rays from one place: free up to length ``free``, hit from there to length ``hit``.

    A ray that hit nothing has a negative ``hit``. A cell through which one ray passed and in which another
    ended counts as hit.
    """
    rows, columns = marks.shape
    for k in range(directions.shape[0]):
        row_direction, column_direction = directions[k, 0], directions[k, 1]
        t = max(_entry(row_origin, row_direction, rows), _entry(column_origin, column_direction, columns))
        end = max(free[k], hit[k])
        if t > end:
            continue
        row = _cell(row_origin + t * row_direction, rows)
        column = _cell(column_origin + t * column_direction, columns)
        while t <= end:
            row_exit = _exit(row, row_origin, row_direction)
            column_exit = _exit(column, column_origin, column_direction)
            leave = min(row_exit, column_exit)
            if leave > t:
                if leave <= free[k]:
                    marks[row, column] = max(marks[row, column], FREE)
                elif t <= hit[k]:
                    marks[row, column] = HIT
                t = leave
            if row_exit <= column_exit:
                row += 1 if row_direction > 0.0 else -1
            else:
                column += 1 if column_direction > 0.0 else -1
            if row < 0 or row >= rows or column < 0 or column >= columns:
                break


@kernel(
    "void(float64[:, ::1], float64[:, ::1], uint8[:, ::1], int64, int64, int64, int64, float64, float64, float64)",
    exact=True,
)
def settle(
    log_odds: Float64Array,
    prior: Float64Array,
    marks: ByteArray,
    first_row: int,
    last_row: int,
    first_column: int,
    last_column: int,
    free: float,
    hit: float,
    limit: float,
) -> None:
    """Table 4.2 for every marked cell of a window: add ``free`` or ``hit`` less the prior; clear the marks."""
    for row in range(first_row, last_row):
        for column in range(first_column, last_column):
            seen = marks[row, column]
            if seen != 0:
                evidence = (hit if seen == HIT else free) - prior[row, column]
                log_odds[row, column] = max(-limit, min(limit, log_odds[row, column] + evidence))
                marks[row, column] = np.uint8(0)


@kernel(
    "void(uint8[:, ::1], float64[::1], float64[::1], float64[::1], float64[::1], float64, float64[::1])",
    exact=True,
)
def cast(
    blocked: ByteArray,
    row_origins: Float64Array,
    column_origins: Float64Array,
    row_directions: Float64Array,
    column_directions: Float64Array,
    longest: float,
    lengths: Float64Array,
) -> None:
    """Length of each ray to where it enters the first blocked cell; infinity if none within ``longest``."""
    rows, columns = blocked.shape
    for k in range(lengths.size):
        row_origin, column_origin = row_origins[k], column_origins[k]
        row_direction, column_direction = row_directions[k], column_directions[k]
        lengths[k] = math.inf
        t = max(_entry(row_origin, row_direction, rows), _entry(column_origin, column_direction, columns))
        if t > longest:
            continue
        row = _cell(row_origin + t * row_direction, rows)
        column = _cell(column_origin + t * column_direction, columns)
        while t <= longest:
            row_exit = _exit(row, row_origin, row_direction)
            column_exit = _exit(column, column_origin, column_direction)
            leave = min(row_exit, column_exit)
            if leave > t:
                if blocked[row, column] != 0:
                    lengths[k] = t
                    break
                t = leave
            if row_exit <= column_exit:
                row += 1 if row_direction > 0.0 else -1
            else:
                column += 1 if column_direction > 0.0 else -1
            if row < 0 or row >= rows or column < 0 or column >= columns:
                break
