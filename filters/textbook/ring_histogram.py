"""Exercise 2: the ring of :mod:`filters.textbook.ring` by the histogram filter.

The start (question a): x and y by their Gaussian, the heading uniform over one circle of cells, for a variance of
10,000 rad² knows nothing of it. The motion (b) is deterministic, so all blur in the result is the grid's own: a cell is
moved by its mean state, to the cell that this falls in. A cell's width in heading should be no more than what one metre
of driving turns it into, sideways: 0.1 rad for a ring 0.1 m thick. Coarser headings leave gaps between their blobs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from filters.cells import CellIntegral
from filters.grid import Axis, Columns, Grid, circle
from filters.histogram import HistogramFilter
from filters.textbook import normal, ring
from filters.textbook.ring import Position

REACH = 1.6
"""How far the grid goes on either side in x and y, metres: six standard deviations beyond the ring."""
WIDTH = 0.05
"""Of a cell in x and y, metres."""
HEADINGS = 64
"""Cells of the heading."""
WIDTHS = (0.2, 0.1, 0.05)
HEADING_COUNTS = (8, 16, 32, 64, 128)
_POINTS = 8


@dataclass(frozen=True)
class Histogram:
    """The belief over a grid.

    Attributes
    ----------
    grid : Grid
        Axes x, y, heading.
    predicted, corrected : (x, y, heading) float64
        Probabilities after the motion and after the measurement.
    moments : Position
        Of x and y.
    distances : (2,) float64
        Total variation from the exact probabilities of the cells in x and y, after the motion and after the
        measurement; 0 to 1.
    """

    grid: Grid
    predicted: NDArray[np.float64]
    corrected: NDArray[np.float64]
    moments: Position
    distances: NDArray[np.float64]


@dataclass(frozen=True)
class Resolution:
    """What finer cells gain.

    Attributes
    ----------
    widths : (w,) float64
        Of the cells in x and y, metres.
    headings : (h,) int64
        Cells of the heading.
    cells : (w, h) int64
        Of the whole grid.
    distances : (w, h, 2) float64
        As in :class:`Histogram`.
    """

    widths: NDArray[np.float64]
    headings: NDArray[np.int64]
    cells: NDArray[np.int64]
    distances: NDArray[np.float64]


def histogram(width: float = WIDTH, headings: int = HEADINGS, measured: float = ring.MEASURED) -> Histogram:
    """Exercise 2 by the histogram filter."""
    side = Axis(-REACH, REACH, round(2.0 * REACH / width))
    grid = Grid([side, side, circle(headings)])
    belief = HistogramFilter(grid, CellIntegral(2))
    belief.reset(_start(grid))
    belief.predict(_forward, np.zeros(3))
    predicted = belief.belief.copy()
    moments = [belief.moments()]
    log_evidence = belief.update(
        lambda states: np.log(normal.density(measured, states[0], math.sqrt(ring.NOISE)))
    )
    moments.append(belief.moments())
    corrected = belief.belief.copy()
    exact = cell_probabilities(side, measured)
    distances = [
        0.5 * float(np.abs(found.sum(axis=2) - truth).sum())
        for found, truth in zip((predicted, corrected), exact, strict=True)
    ]
    position = Position(
        np.array([mean[:2] for mean, _ in moments]),
        np.array([covariance[:2, :2] for _, covariance in moments]),
        log_evidence,
    )
    return Histogram(grid, predicted, corrected, position, np.array(distances))


def resolution(widths: tuple[float, ...] = WIDTHS, headings: tuple[int, ...] = HEADING_COUNTS) -> Resolution:
    """Exercise 2 over several widths of the cells and numbers of headings."""
    runs = [[histogram(width, count) for count in headings] for width in widths]
    return Resolution(
        np.array(widths),
        np.array(headings),
        np.array([[run.grid.size for run in row] for row in runs]),
        np.array([[run.distances for run in row] for row in runs]),
    )


def cell_probabilities(side: Axis, measured: float = ring.MEASURED) -> tuple[NDArray[np.float64], ...]:
    """Exact probabilities of the cells in x and y, before and after the measurement, by the mid-point rule."""
    fine = Axis(side.low, side.high, side.cells * _POINTS).centres
    found: list[NDArray[np.float64]] = []
    for values in (
        ring.density(fine[:, None], fine[None, :]),
        ring.posterior(fine[:, None], fine[None, :], measured),
    ):
        blocks = values.reshape(side.cells, _POINTS, side.cells, _POINTS)
        found.append(blocks.sum(axis=(1, 3)) * (side.width / _POINTS) ** 2)
    return tuple(found)


def _start(grid: Grid) -> NDArray[np.float64]:
    """Probabilities of the cells at the start: exact along each axis, and uniform in the heading."""
    side = grid.axes[0]
    edges = side.low + np.arange(side.cells + 1) * side.width
    along = np.diff(normal.cumulative(edges, 0.0, math.sqrt(ring.VARIANCE)))
    return along[:, None, None] * along[None, :, None] * np.ones(grid.shape[2])


def _forward(states: Columns) -> list[ArrayLike]:
    x, y, heading = states
    return [x + np.cos(heading), y + np.sin(heading), heading]
