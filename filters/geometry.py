"""Where the cells of a map lie: a grid of squares, north up the rows and east along the columns."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

MOST_CELLS = 1 << 28
"""A map larger than this is a mistake in its resolution."""


@dataclass(frozen=True, slots=True)
class GridGeometry:
    """Place and size of a grid of square cells, its sides along north and east.

    Cell (i, j) holds north in [north + i · resolution, north + (i + 1) · resolution) and east likewise by j.

    Attributes
    ----------
    resolution : float
        Side of a cell, metres.
    north, east : float
        The south-west corner of cell (0, 0), metres.
    rows, columns : int
        How many cells northward and eastward.

    Raises
    ------
    ValueError
        A resolution that is not positive, a place that is not finite, or a size below 1 or above 2²⁸ cells.
    """

    resolution: float
    north: float
    east: float
    rows: int
    columns: int

    def __post_init__(self) -> None:
        if not 0.0 < self.resolution < math.inf:
            raise ValueError(f"grid: resolution must be positive and finite, got {self.resolution} m")
        if not (math.isfinite(self.north) and math.isfinite(self.east)):
            raise ValueError(f"grid: its corner must be finite, got north {self.north}, east {self.east}")
        if self.rows < 1 or self.columns < 1 or self.rows * self.columns > MOST_CELLS:
            raise ValueError(
                f"grid: 1 to {MOST_CELLS} cells are possible, got {self.rows} rows and {self.columns} columns"
            )

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.rows, self.columns

    def cells(self, north: ArrayLike, east: ArrayLike) -> tuple[Array, Array]:
        """Row and column of places, as real numbers: the whole part is the cell, if it lies in the grid."""
        row = (np.asarray(north, np.float64) - self.north) / self.resolution
        column = (np.asarray(east, np.float64) - self.east) / self.resolution
        return row, column

    def centres(self) -> tuple[Array, Array]:
        """North of each row's middle, (rows,), and east of each column's, (columns,), metres."""
        rows, columns = np.arange(self.rows, dtype=np.float64), np.arange(self.columns, dtype=np.float64)
        return self.north + self.resolution * (rows + 0.5), self.east + self.resolution * (columns + 0.5)
