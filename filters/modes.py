"""The modes of a particle set: places with a valley of little density between them.

A mixture of Gaussians is no answer to how many places a belief holds: it takes several of them to fill a bent one. Here
the density of a fair sub-sample is estimated on a small grid in the frame where the positions have unit covariance, and
its hills are told apart by persistence (:mod:`filters.kernels.modes`): two are two only where the saddle between them
lies deep below the lower summit, and deeper than chance would have it. A ring, a banana, a whole area are one hill.
Where the positions are one hill, the headings are asked in the same way, on a circle.

The frame sees no finer than about a third of the whole's deviation. What is finer comes out when each hill is asked
by itself (:mod:`filters.hypotheses` does, over time).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from filters.kernels import modes as kernels
from filters.kernels.compile import Float32Array, Int32Array

SIDE = 26
"""Cells along a side of the grid."""
CELL = 0.4
"""Side of a cell, in deviations of the whole; beyond the grid, 4.4 of them, it counts at its edge."""
BINS = 40
"""Of the circle: 9 degrees each."""
PASSES = 1
"""Of smoothing: with the cells' own width the kernel's deviation is 0.33 deviations of the whole."""
NARROW = 0.3
"""Radians of deviation below which headings are not asked: two modes would blend at the circle's resolution."""

_SQUARES = float(np.square([1, 2, 1]).sum()) / 4.0**2
"""Σ K² of the smoothing along one side: how much it takes off a count's variance."""


class Depth(NamedTuple):
    """What makes a valley.

    Attributes
    ----------
    ratio : float
        Highest saddle, over the lower summit.
    significance : float
        Standard deviations by which the two must differ, for as many independent particles as the weights are worth.
    least : float
        Smallest share of the particles' weight that is a mode.
    """

    ratio: float
    significance: float
    least: float


class Modes:
    """Looks for modes in buffers that are allocated once.

    Parameters
    ----------
    resolution : float
        Metres; places nearer to each other than about twice this are one.
    sample : int
        Most particles that are looked at.
    most : int
        Most modes that are found in one look.

    Attributes
    ----------
    masses : (most,) float64
        The share of each mode that the last look found.

    Raises
    ------
    ValueError
        A parameter that is not positive.
    """

    def __init__(self, resolution: float, *, sample: int = 1024, most: int = 8) -> None:
        if not resolution > 0.0 or sample < 1 or most < 1:
            raise ValueError(
                f"modes: resolution, sample and most must be positive, got {resolution} m, {sample} and {most}"
            )
        self._resolution = resolution
        self._least_variance = (0.5 * resolution) ** 2
        self._frame = np.zeros(kernels.FRAME)
        self._some: Float32Array = np.zeros((3, sample), np.float32)
        self._some_weights: Float32Array = np.zeros(sample, np.float32)
        self._grids = {shape: _Grid(shape) for shape in ((SIDE, SIDE), (1, BINS))}
        self._by_heading = False
        self._numbers: Int32Array = np.zeros(1, np.int32)
        self.masses: NDArray[np.float64] = np.zeros(most)

    def look(
        self,
        columns: Float32Array,
        weights: Float32Array,
        labels: Int32Array,
        count: int,
        factors: Float32Array,
        depth: Depth,
    ) -> int:
        """Return how many modes the particles of some labels have, at least one.

        Parameters
        ----------
        columns : (>= 3, >= count) float32
            North, east, heading.
        weights : (>= count,) float32
        labels : (>= count,) int32
        count : int
        factors : (number of labels,) float32
            What each label's weights count, zero for those not asked.
        depth : Depth
        """
        self._by_heading = False
        taken = kernels.gather.direct(
            columns, weights, labels, count, factors, self._some, self._some_weights
        )
        if taken == 0:
            return 1
        frame = self._frame
        kernels.survey.direct(self._some, self._some_weights, taken, self._least_variance, frame)
        size = float(frame[5])
        if size * depth.least < 2.0:
            return 1
        found = self._by_position(taken, depth)
        if found < 2 and frame[7] < math.exp(-0.5 * NARROW**2):
            found = self._by_headings(taken, depth)
        return max(1, found)

    def _by_position(self, taken: int, depth: Depth) -> int:
        """Ask the positions; they are one if none of them can lie a resolution away from where most are."""
        frame = self._frame
        if frame[6] < depth.least * (1.0 - depth.least) * self._resolution**2:
            return 1
        grid = self._grids[SIDE, SIDE]
        kernels.spread.direct(self._some, self._some_weights, taken, frame, CELL, grid.density)
        self._numbers = grid.numbers
        return grid.hills(depth, _SQUARES**-2, self.masses, around=False)

    def _by_headings(self, taken: int, depth: Depth) -> int:
        grid = self._grids[1, BINS]
        size = float(self._frame[5])
        kernels.spread_angles.direct(self._some[2], self._some_weights, taken, size, grid.density)
        self._by_heading = True
        self._numbers = grid.numbers
        return grid.hills(depth, 1.0 / _SQUARES, self.masses, around=True)

    def relabel(
        self, columns: Float32Array, labels: Int32Array, count: int, old: int, names: Int32Array
    ) -> None:
        """Give each particle of the label ``old`` that of its mode, ``names`` (number of modes,), by the last look."""
        if self._by_heading:
            kernels.relabel_angles.direct(columns, labels, count, old, self._numbers, names)
        else:
            kernels.relabel.direct(columns, labels, count, old, self._frame, CELL, SIDE, self._numbers, names)


class _Grid:
    """The density on a grid, and its hills."""

    def __init__(self, shape: tuple[int, int]) -> None:
        size = shape[0] * shape[1]
        self.density = np.zeros(shape)
        self.numbers: Int32Array = np.zeros(size, np.int32)
        self._spare = np.zeros(shape)
        self._order = np.zeros(size, np.int64)
        self._parents: Int32Array = np.zeros(size, np.int32)

    def hills(self, depth: Depth, worth: float, masses: NDArray[np.float64], *, around: bool) -> int:
        """Smooth, find the hills, and number the cells by them."""
        kernels.smooth.direct(self.density, self._spare, PASSES, around)
        there = kernels.descending.direct(self.density.reshape(-1), self._order)
        order = self._order[:there]
        kernels.hills.direct(
            self.density, order, around, depth.ratio, depth.significance, worth, self._parents
        )
        return kernels.regions.direct(self.density, around, depth.least, self._parents, self.numbers, masses)
