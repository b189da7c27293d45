"""Figure 4.2: static and dynamic decomposition, with equally many cells.

The standard example's Y, somewhere in a space ten times as long as its standard deviation is wide. A static grid spends
most of its cells where nothing is; a density tree cuts a cell in half as long as it holds more than its share.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from filters.density_tree import DensityTree, DensityTreeFilter
from filters.grid import Columns
from filters.textbook import transform
from filters.textbook.histogram import density_error
from filters.textbook.normal import Vector
from filters.tree_nodes import Side

SPAN = (-4.0, 6.0)
CELLS = 20
COUNTS = (5, 10, 20, 40, 80, 160, 320)
_FINEST = 2e-3
_COARSEST = 2.5
_HALVINGS = 9


@dataclass(frozen=True)
class Partition:
    """A density that is constant in each of some cells.

    Attributes
    ----------
    edges : (cells + 1,) float64
    probabilities : (cells,) float64
    depths : (cells,) int64
        How often the space was cut in half for each; all equal for the grid, and 0.
    error : float
        Half the integral of the difference from the exact density.
    """

    edges: Vector
    probabilities: Vector
    depths: NDArray[np.int64]
    error: float


@dataclass(frozen=True)
class Accuracy:
    """Error against the number of cells.

    Attributes
    ----------
    grid_cells, tree_cells : (n,) int64
    grid_errors, tree_errors : (n,) float64
    """

    grid_cells: NDArray[np.int64]
    grid_errors: Vector
    tree_cells: NDArray[np.int64]
    tree_errors: Vector


def grid(cells: int = CELLS) -> Partition:
    """Cut the space into equal cells, with their exact probabilities."""
    edges = np.linspace(*SPAN, cells + 1)
    probabilities = np.diff(transform.cumulative(edges))
    return Partition(edges, probabilities, np.zeros(cells, np.int64), density_error(edges, probabilities))


def tree(cells: int = CELLS) -> Partition:
    """Grow the density tree whose number of leaves comes closest to ``cells``, from below."""
    few, many = 0.9, 0.2 / cells
    for _ in range(_HALVINGS):
        middle = (few * many) ** 0.5
        few, many = (middle, many) if _grown(middle).leaf_count <= cells else (few, middle)
    best = _grown(few)
    low, high, masses = best.leaf_boxes
    order = np.argsort(low[:, 0])
    edges = np.append(low[order, 0], high[order[-1], 0])
    depths = np.round(np.log2((SPAN[1] - SPAN[0]) / np.diff(edges))).astype(np.int64)
    return Partition(edges, masses[order], depths, density_error(edges, masses[order]))


def accuracy(counts: tuple[int, ...] = COUNTS) -> Accuracy:
    """Measure the error of both over several numbers of cells."""
    grids, trees = [grid(count) for count in counts], [tree(count) for count in counts]
    return Accuracy(
        np.array([part.depths.size for part in grids]),
        np.array([part.error for part in grids]),
        np.array([part.depths.size for part in trees]),
        np.array([part.error for part in trees]),
    )


def _grown(bound: float) -> DensityTree:
    belief = DensityTreeFilter([Side(*SPAN, finest=_FINEST, coarsest=_COARSEST)], bound)
    belief.initialize(_log_density)
    return belief.tree


def _log_density(states: Columns) -> Vector:
    with np.errstate(divide="ignore"):
        return np.log(transform.density(states[0]))
