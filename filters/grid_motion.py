"""How a motion with Gaussian noise carries the probabilities of a grid's cells (eq. 4.5, 4.9 and 4.10).

p(x_k | u, x_i) is a product over the axes, each factor a window of target cells around the mean that the
source cell is moved to. Where the axes can be ordered so that none is moved by one that was moved before it,
they are moved one after the other, which costs the sum of the windows in place of their product, and the
result is the same: a vehicle's position first, each layer of one heading by one shift, then its heading.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from filters.cells import Cells
from filters.grid import MOST_AXES, Array, Columns, Grid, Indices, broadcasts
from filters.kernels import histogram as kernels

Move = Callable[[Columns], Sequence[ArrayLike]]
"""Where states move without noise: columns in, columns out; what is returned broadcasts against the states."""

TAIL = 7.0
"""Standard deviations of the noise that are followed; beyond lie 3e-12, dealt to the cells within."""

SHARP = 1e-6
"""Noise of at most this many cell widths is none: all goes to the cell that the mean lies in."""

BLOCK = 16_384


class GridMotion:
    """What moves the probabilities of a grid's cells.

    Parameters
    ----------
    grid : Grid
        Whose cells they are.
    cells : Cells
        What a cell stands for.
    """

    def __init__(self, grid: Grid, cells: Cells) -> None:
        self.grid = grid
        self._cells = cells
        self._nodes = cells.nodes(grid.dimension)

    def carry(self, belief: Array, chosen: Indices, move: Move, sigma: ArrayLike) -> tuple[Array, float]:
        """Move the probabilities of chosen cells; the others stay.

        Parameters
        ----------
        belief : float64 array of the grid's shape
            Not written to.
        chosen : (n,) int64
            Flat indices of the cells to move.
        move : callable
            See ``Move``.
        sigma : (dimension,) array
            Standard deviations of the noise; 0 for none.

        Returns
        -------
        target : float64 array of the grid's shape
            Not normalised: it sums to what has stayed in the grid.
        departed : float
            The probability that has left it.

        Raises
        ------
        ValueError
            A sigma negative or not finite, or a motion that gives a number that is not finite or columns that
            do not fit.
        """
        sigmas = self._checked_sigma(sigma)
        reach = np.array([self._window(k, float(sigma)) for k, sigma in enumerate(sigmas)])
        if len(self._nodes.weights) == 1:
            moved = self._moved(move, self.grid.states())
            order = _order(moved)
            if order and reach.sum() * self.grid.size <= reach.prod() * chosen.size:
                return self._by_axes(belief, moved, order, sigmas, chosen)
        return self._by_cells(belief, move, sigmas, chosen)

    def _by_axes(
        self, belief: Array, moved: list[Array], order: list[int], sigmas: Array, chosen: Indices
    ) -> tuple[Array, float]:
        """Move along one axis after the other.

        The array is laid out anew for each: first the axes that steer it, then itself, then the rest, which
        all move alike.
        """
        source, rest = belief, None
        if chosen.size < self.grid.size:
            rest = belief.copy()
            rest.reshape(-1)[chosen] = 0.0
            source = belief - rest
        departed = 0.0
        layout = list(range(self.grid.dimension))
        for axis in order:
            steering = [k for k in layout if k != axis and moved[axis].shape[k] > 1]
            wanted = [*steering, axis, *(k for k in layout if k != axis and k not in steering)]
            source = np.ascontiguousarray(source.transpose([layout.index(k) for k in wanted]))
            layout = wanted
            source, left = self._along(source, layout, axis, moved[axis], float(sigmas[axis]))
            departed += left
        source = np.ascontiguousarray(source.transpose(np.argsort(layout)))
        return (source if rest is None else source + rest), departed

    def _along(
        self, source: Array, layout: list[int], axis: int, moved: Array, sigma: float
    ) -> tuple[Array, float]:
        cells = self.grid.shape[axis]
        shape = tuple(cells if k == axis else size for k, size in enumerate(moved.shape))
        means = np.broadcast_to(moved, shape).transpose(layout).reshape(-1)
        lines = means.size // cells
        places, shares = self._targets(axis, means, sigma)
        target = np.empty_like(source)
        departed = kernels.spread(
            source.reshape(lines, cells, -1),
            places.reshape(lines, cells, -1),
            shares.reshape(lines, cells, -1),
            target.reshape(lines, cells, -1),
        )
        return target, departed

    def _by_cells(self, belief: Array, move: Move, sigmas: Array, chosen: Indices) -> tuple[Array, float]:
        target = belief.copy()
        flat = target.reshape(-1)
        flat[chosen] = 0.0
        masses = belief.reshape(-1)[chosen]
        departed = 0.0
        for start in range(0, chosen.size, BLOCK):
            block = slice(start, start + BLOCK)
            centres = self.grid.states_at(chosen[block])
            for offset, weight in zip(*self._nodes, strict=True):
                steps = offset * self.grid.widths
                moved = self._moved(move, [c + step for c, step in zip(centres, steps, strict=True)])
                first, second, third, fourth = (
                    self._flat_targets(axis, moved, sigmas, masses[block].size) for axis in range(MOST_AXES)
                )
                departed += kernels.scatter(weight * masses[block], *first, *second, *third, *fourth, flat)
        return target, departed

    def _flat_targets(
        self, axis: int, moved: list[Array], sigmas: Array, count: int
    ) -> tuple[Indices, Array]:
        if axis >= self.grid.dimension:
            return np.zeros((count, 1), np.int64), np.ones((count, 1))
        means = np.broadcast_to(moved[axis], (count,))
        places, shares = self._targets(axis, means, float(sigmas[axis]))
        return np.where(places < 0, -1, places * self.grid.strides[axis]), shares

    def _targets(self, axis: int, means: Array, sigma: float) -> tuple[Indices, Array]:
        """Return the cells along an axis around each mean, -1 beyond its ends, and their probabilities."""
        along = self.grid.axes[axis]
        nearest = np.floor((means - along.low) / along.width)
        window = self._window(axis, sigma)
        offsets = np.arange(window) - window // 2
        excess = means - along.low - nearest * along.width
        nearest = np.mod(nearest, along.cells) if along.wraps else np.clip(nearest, -1e9, 1e9)
        places = nearest.astype(np.int64)[:, None] + offsets
        if along.wraps:
            places %= along.cells
        else:
            places[(places < 0) | (places >= along.cells)] = -1
        if window == 1:
            return places, np.ones((means.size, 1))
        distances = (offsets + 0.5) * along.width - excess[:, None]
        return places, self._cells.shares(distances, along.width, sigma)

    def _window(self, axis: int, sigma: float) -> int:
        width = self.grid.axes[axis].width
        return 1 if sigma <= SHARP * width else 2 * math.ceil(TAIL * sigma / width) + 1

    def _moved(self, move: Move, states: list[Array]) -> list[Array]:
        moved = [np.asarray(column, np.float64) for column in move(states)]
        shape = np.broadcast_shapes(*(state.shape for state in states))
        if len(moved) != self.grid.dimension:
            raise ValueError(f"histogram motion: {self.grid.dimension} columns are needed, got {len(moved)}")
        for column in moved:
            if not broadcasts(column.shape, shape):
                raise ValueError(f"histogram motion: columns of {shape} are needed, got {column.shape}")
            if not np.isfinite(column).all():
                raise ValueError(
                    "histogram motion: every state must move to a finite one, got NaN or infinity"
                )
        return [column.reshape((1,) * (len(shape) - column.ndim) + column.shape) for column in moved]

    def _checked_sigma(self, sigma: ArrayLike) -> Array:
        sigmas = np.array(sigma, np.float64, ndmin=1)
        if sigmas.shape != (self.grid.dimension,) or not np.isfinite(sigmas).all() or (sigmas < 0.0).any():
            raise ValueError(
                f"histogram motion: sigma must be {self.grid.dimension} finite numbers, not negative, got "
                f"{sigmas.tolist()}"
            )
        return sigmas


def _order(moved: list[Array]) -> list[int]:
    """Order the axes so that none that is still to be moved depends on one already moved; empty if impossible."""
    remaining, order = set(range(len(moved))), list[int]()
    while remaining:
        free = [
            k for k in remaining if not any(moved[other].shape[k] > 1 for other in remaining if other != k)
        ]
        if not free:
            return []
        order.append(min(free))
        remaining.remove(order[-1])
    return order
