"""A histogram of a particle set, figure 4.5 (c): the weight in each cell of a static grid, over its volume.

What comes out is a :class:`~filters.histogram.HistogramFilter`: a density to ask, and a belief to go on filtering
with. Its density is found in a time that depends neither on the number of particles nor on that of cells; its
memory grows exponentially with the dimensions.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from filters.density.protocol import Array
from filters.density.weighted import Weighted, weighted
from filters.grid import MOST_AXES, Axis, Grid, circle
from filters.histogram import HistogramFilter

MOST_CELLS = 1 << 22
"""Cells that a grid chosen by the rule may have; above, they are widened."""


def scott_widths(particles: Weighted) -> Array:
    """Width of a cell in each dimension, (d,): 3.49 σ n^(-1/(d + 2)), n the effective sample size.

    Scott, "On optimal and data-based histograms", Biometrika 66(3), 1979; the exponent for d dimensions from
    Scott, *Multivariate Density Estimation*, 1992, section 3.4.
    """
    size = particles.points.shape[1]
    deviation = np.sqrt(np.diag(particles.moments().covariance))
    return 3.49 * deviation * particles.effective_sample_size ** (-1.0 / (size + 2))


class Histograms:
    """The :class:`~filters.density.protocol.Extractor` of a histogram.

    Parameters
    ----------
    grid : Grid, optional
        The cells; particles outside do not count. If not given, a grid about the particles with cells by
        Scott's rule.

    Raises
    ------
    ValueError
        More than four dimensions.
    """

    def __init__(self, grid: Grid | None = None) -> None:
        self._grid = grid

    def __call__(
        self, points: ArrayLike, weights: ArrayLike | None = None, circular: Sequence[bool] | None = None
    ) -> HistogramFilter:
        """Extract a histogram.

        Raises
        ------
        ValueError
            As the protocol says; a grid that does not fit, or no weight in it; more than four dimensions.
        """
        particles = weighted("histogram extraction", points, weights, circular)
        grid = grid_about(particles) if self._grid is None else self._grid
        if grid.wraps != tuple(bool(flag) for flag in particles.circular):
            raise ValueError(
                f"histogram extraction: the grid wraps along {grid.wraps}, the particles along "
                f"{particles.circular.tolist()}"
            )
        cells = grid.cell_of(particles.points)
        inside = cells >= 0
        masses = np.bincount(cells[inside], particles.weights[inside], grid.size)
        total = float(masses.sum())
        if total <= 0.0:
            raise ValueError("histogram extraction: no particle with a positive weight lies in the grid")
        density = HistogramFilter(grid)
        density.reset((masses / total).reshape(grid.shape))
        return density


def grid_about(particles: Weighted) -> Grid:
    """Return the smallest grid about all particles with cells of Scott's widths.

    Raises
    ------
    ValueError
        More than four dimensions.
    """
    size = particles.points.shape[1]
    if size > MOST_AXES:
        raise ValueError(
            f"histogram extraction: at most {MOST_AXES} dimensions, got {size}; take a density tree"
        )
    low, high = particles.points.min(axis=0), particles.points.max(axis=0)
    low, high = low - 1e-9 * (1.0 + np.abs(low)), high + 1e-9 * (1.0 + np.abs(high))
    length = np.where(particles.circular, 2.0 * math.pi, high - low)
    widths = np.where(particles.moments().covariance.diagonal() > 0.0, scott_widths(particles), length)
    cells = np.maximum(np.ceil(length / widths), 1.0)
    while float(cells.prod()) > MOST_CELLS:
        cells = np.maximum(np.ceil(0.9 * cells), 1.0)
    axes = [
        circle(int(count)) if wraps else Axis(float(a), float(b), int(count))
        for a, b, count, wraps in zip(low, high, cells, particles.circular, strict=True)
    ]
    return Grid(axes)
