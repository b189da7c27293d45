"""Figure 4.1: the standard example as a histogram, and how its error falls with the number of cells.

X is cut into cells (equation 4.1), each with one probability and so one density (equation 4.2). Points of every cell
are passed through the function, and their share of the probability is counted in the cell of Y that they fall into:
the motion of :class:`filters.histogram.HistogramFilter`, without noise, with the integral over the source cell of
equation 4.9 taken over as many points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from filters.cells import CellIntegral
from filters.grid import Axis, Columns, Grid
from filters.histogram import HistogramFilter
from filters.textbook import normal, transform
from filters.textbook.normal import Vector

SPAN = (-1.0, 3.0)
"""Of the cells of X and of Y: four standard deviations of X."""
CELLS = 10
POINTS = 8
"""That each cell of X is represented by."""
COUNTS = (5, 10, 20, 40, 80, 160, 320, 640)
_FINE = 16


@dataclass(frozen=True)
class Histogram:
    """X and Y in equal cells.

    Attributes
    ----------
    edges : (cells + 1,) float64
    before, after : (cells,) float64
        Probabilities of X, exact, and of Y, by the histogram filter.
    exact : (cells,) float64
        Probabilities of Y.
    """

    edges: Vector
    before: Vector
    after: Vector
    exact: Vector


@dataclass(frozen=True)
class Accuracy:
    """Error against the number of cells.

    Attributes
    ----------
    points : int
        Of each cell.
    counts : (n,) int64
        Cells.
    cell_errors : (n,) float64
        Total variation of the cells' probabilities of Y from the exact ones.
    density_errors : (n,) float64
        Half the integral of the difference of the densities: what cells cost even where their probabilities are right.
    """

    points: int
    counts: NDArray[np.int64]
    cell_errors: Vector
    density_errors: Vector


def histogram(cells: int = CELLS, points: int = POINTS) -> Histogram:
    """Pass the histogram of X through the function."""
    axis = Axis(*SPAN, cells)
    edges = np.linspace(*SPAN, cells + 1)
    belief = HistogramFilter(Grid([axis]), CellIntegral(points))
    belief.reset(np.diff(normal.cumulative(edges, transform.MEAN, transform.SIGMA)))
    before = belief.belief.copy()
    belief.predict(_through, [0.0])
    return Histogram(edges, before, belief.belief.copy(), np.diff(transform.cumulative(edges)))


def accuracy(points: int, counts: tuple[int, ...] = COUNTS) -> Accuracy:
    """Measure both errors over several numbers of cells."""
    runs = [histogram(count, points) for count in counts]
    return Accuracy(
        points,
        np.array(counts),
        np.array([0.5 * float(np.abs(run.after - run.exact).sum()) for run in runs]),
        np.array([density_error(run.edges, run.after) for run in runs]),
    )


def density_error(edges: Vector, probabilities: Vector) -> float:
    """Half the integral of |equation 4.2 - exact density of Y|, what lies beyond the cells included."""
    widths = np.diff(edges)
    inner = (np.arange(_FINE) + 0.5) / _FINE
    y = edges[:-1, None] + widths[:, None] * inner
    differences = np.abs((probabilities / widths)[:, None] - transform.density(y)).mean(axis=1) * widths
    beyond = 1.0 - float(transform.cumulative(edges[-1]) - transform.cumulative(edges[0]))
    return 0.5 * (float(differences.sum()) + beyond)


def _through(states: Columns) -> list[ArrayLike]:
    return [transform.function(states[0])]
