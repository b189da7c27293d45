"""A static decomposition of a continuous state space: a grid of cells in one to four dimensions (eq. 4.1).

Every cell is a box of the same size, so its volume cancels in normalising; an axis may close on itself, as an
angle does. States travel as columns, one array for each axis, that broadcast against each other: for a whole
grid each column varies along its own axis only, so what depends on two axes costs only their cells.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from filters.density.protocol import DensityMoments

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Columns = Sequence[Array]
"""States, one array for each axis, that broadcast against each other."""

LogDensity = Callable[[Columns], ArrayLike]
"""Logarithm of a density or likelihood at each of the states: below infinity, never NaN."""

MOST_AXES = 4


@dataclass(frozen=True)
class Axis:
    """One dimension of a grid, cut into equal cells.

    Parameters
    ----------
    low, high : float
        Where it begins and ends, in the state's unit.
    cells : int
        How many, at least 1.
    wraps : bool
        Whether it closes on itself: ``high`` is ``low`` again. For an angle from -pi to pi.

    Raises
    ------
    ValueError
        Ends that are not finite or not in order, or no cells.
    """

    low: float
    high: float
    cells: int
    wraps: bool = False

    def __post_init__(self) -> None:
        if not -math.inf < self.low < self.high < math.inf:
            raise ValueError(f"axis: low < high, both finite, are needed, got {self.low} and {self.high}")
        if self.cells < 1:
            raise ValueError(f"axis: at least 1 cell is needed, got {self.cells}")

    @property
    def width(self) -> float:
        """Of a cell."""
        return (self.high - self.low) / self.cells

    @property
    def centres(self) -> Array:
        """Mean state of each cell (eq. 4.3), (cells,)."""
        return self.low + (np.arange(self.cells, dtype=np.float64) + 0.5) * self.width


def circle(cells: int) -> Axis:
    """Make the axis of an angle, -pi to pi."""
    return Axis(-math.pi, math.pi, cells, wraps=True)


class Grid:
    """A box cut into equal cells.

    Parameters
    ----------
    axes : sequence of Axis
        One to four.

    Raises
    ------
    ValueError
        No axis, or more than four.
    """

    def __init__(self, axes: Sequence[Axis]) -> None:
        if not 1 <= len(axes) <= MOST_AXES:
            raise ValueError(f"grid: 1 to {MOST_AXES} axes are needed, got {len(axes)}")
        self.axes = tuple(axes)
        self.shape = tuple(axis.cells for axis in axes)
        self.size = math.prod(self.shape)
        self.widths: Array = np.array([axis.width for axis in axes])
        self.volume = float(self.widths.prod())
        self.wraps = tuple(axis.wraps for axis in axes)
        self.strides = tuple(math.prod(self.shape[k + 1 :]) for k in range(len(axes)))

    @property
    def dimension(self) -> int:
        """How many axes."""
        return len(self.axes)

    def states(self) -> list[Array]:
        """Mean states of all cells, a column for each axis that varies along this axis only."""
        size = self.dimension
        return [
            axis.centres.reshape([-1 if k == place else 1 for k in range(size)])
            for place, axis in enumerate(self.axes)
        ]

    def states_at(self, cells: Indices) -> list[Array]:
        """Mean states of some cells, by their flat indices, a column (n,) for each axis."""
        places = np.unravel_index(cells, self.shape)
        return [axis.centres[place] for axis, place in zip(self.axes, places, strict=True)]

    def cell_of(self, points: ArrayLike) -> Indices:
        """Find the cells that points lie in.

        Parameters
        ----------
        points : (n, dimension) array
            A coordinate on an axis that wraps may lie anywhere.

        Returns
        -------
        (n,) int64
            Flat indices; -1 outside the grid.

        Raises
        ------
        ValueError
            Points of another shape, or not finite.
        """
        given = checked_points("grid", points, self.dimension)
        flat = np.zeros(len(given), np.int64)
        inside = np.ones(len(given), np.bool_)
        for axis, column, stride in zip(self.axes, given.T, self.strides, strict=True):
            place = np.floor((column - axis.low) / axis.width)
            place = np.mod(place, axis.cells) if axis.wraps else place
            inside &= (place >= 0) & (place < axis.cells)
            flat += np.where(inside, place, 0.0).astype(np.int64) * stride
        return np.where(inside, flat, -1)


def broadcasts(shape: tuple[int, ...], goal: tuple[int, ...]) -> bool:
    """Say whether an array of one shape can be broadcast to another."""
    aligned = zip(reversed(shape), reversed(goal), strict=False)
    return len(shape) <= len(goal) and all(size in (1, wanted) for size, wanted in aligned)


def checked_points(where: str, points: ArrayLike, dimension: int) -> Array:
    """Return points as (n, dimension) float64.

    Raises
    ------
    ValueError
        Another shape, or a number that is not finite.
    """
    given = np.asarray(points, np.float64)
    if given.ndim != 2 or given.shape[1] != dimension:
        raise ValueError(f"{where}: points must be (n, {dimension}), got {given.shape}")
    if not np.isfinite(given).all():
        raise ValueError(f"{where}: every coordinate of a point must be finite, got NaN or infinity")
    return given


def box_moments(centres: Columns, widths: Columns, masses: Array, periods: Array) -> DensityMoments:
    """Mean and covariance of a density that is constant in each of many boxes (eq. 4.2).

    An axis with a finite period is circular: its mean is the direction of the mean of exp(i x), each box
    taking part by the exact integral over its width, and differences from it are wrapped.

    Parameters
    ----------
    centres, widths : one (n,) array for each axis
        Of the boxes.
    masses : (n,) float64
        Their probabilities; they need not sum to one.
    periods : (dimension,) float64
        Of each axis; infinite where it does not wrap.

    Returns
    -------
    DensityMoments
        The mean of a circular axis lies within half a period of zero; the covariance has the boxes' own
        variance, width² / 12, in it.
    """
    share = masses / masses.sum()
    mean, offsets = np.zeros(len(centres)), np.zeros((len(centres), share.size))
    for k, (centre, width, period) in enumerate(zip(centres, widths, periods, strict=True)):
        if math.isinf(period):
            mean[k] = share @ centre
            offsets[k] = centre - mean[k]
        else:
            angle, spread = 2.0 * math.pi / period * centre, np.sinc(width / period)
            sine, cosine = share @ (spread * np.sin(angle)), share @ (spread * np.cos(angle))
            mean[k] = math.atan2(sine, cosine) * period / (2.0 * math.pi)
            offsets[k] = centre - mean[k]
            offsets[k] -= period * np.round(offsets[k] / period)
    covariance = (offsets * share) @ offsets.T
    covariance += np.diag([float(share @ width**2) / 12.0 for width in widths])
    return DensityMoments(mean, covariance)
