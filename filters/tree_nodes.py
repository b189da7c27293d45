"""The nodes of a density tree: boxes cut in half, where, and what became of their halves.

A node is a row in a few arrays. Its two halves lie beside each other and after it, the first at ``child``. All
that is done here is done to many nodes at once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from filters.grid import Array, Indices

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Side:
    """One dimension of the box that a density tree divides.

    Parameters
    ----------
    low, high : float
        Where it begins and ends, in the state's unit.
    finest : float
        No leaf is cut narrower than this.
    coarsest : float
        No leaf is left wider than this, however improbable; infinite for no such limit.
    wraps : bool
        Whether ``high`` is ``low`` again.

    Raises
    ------
    ValueError
        Ends that are not finite or not in order, a finest width that is not positive, or a coarsest below
        twice the finest.
    """

    low: float
    high: float
    finest: float
    coarsest: float = math.inf
    wraps: bool = False

    def __post_init__(self) -> None:
        if not -math.inf < self.low < self.high < math.inf:
            raise ValueError(
                f"tree side: low < high, both finite, are needed, got {self.low} and {self.high}"
            )
        if not 0.0 < self.finest < math.inf or not self.coarsest >= 2.0 * self.finest:
            raise ValueError(
                "tree side: finest must be positive and coarsest at least twice as wide, got "
                f"{self.finest} and {self.coarsest}"
            )


class Sides:
    """All dimensions of the box, as arrays (dimension,)."""

    def __init__(self, sides: Sequence[Side]) -> None:
        if not sides:
            raise ValueError("density tree: at least one side is needed")
        self.dimension = len(sides)
        self.low: Array = np.array([side.low for side in sides], np.float64)
        self.high: Array = np.array([side.high for side in sides], np.float64)
        self.finest: Array = np.array([side.finest for side in sides], np.float64)
        self.coarsest: Array = np.array([side.coarsest for side in sides], np.float64)
        self.wraps: Mask = np.array([side.wraps for side in sides])
        self.periods: Array = np.where(self.wraps, self.high - self.low, math.inf)

    def folded(self, points: Array) -> Array:
        """Return points with the coordinates that wrap brought into the box."""
        if not self.wraps.any():
            return points
        low, period = self.low[self.wraps], self.periods[self.wraps]
        out = points.copy()
        turned = np.mod(points[:, self.wraps] - low, period) + low
        out[:, self.wraps] = np.where(turned >= low + period, low, turned)
        return out

    def inside(self, points: Array) -> Mask:
        """Say which points, folded, lie in the box."""
        outside = (points < self.low) | (points >= self.high)
        return outside.sum(axis=1) == 0

    def axes_to_cut(self, widths: Array, heavy: Mask) -> Indices:
        """Say along which axis boxes are cut: the widest in units of the finest, if heavy.

        What is wider than the coarsest is cut first, heavy or not. -1 for boxes that stay whole.
        """
        fine = np.where(heavy[:, None], widths / self.finest, 0.0)
        coarse = widths / self.coarsest
        chosen = np.where(fine.max(axis=1) > 2.0 * (1.0 - 1e-9), fine.argmax(axis=1), -1)
        return np.where(coarse.max(axis=1) > 1.0 + 1e-9, coarse.argmax(axis=1), chosen)


class TreeNodes(NamedTuple):
    """The nodes of a tree, the root first.

    Attributes
    ----------
    low, high : (n, dimension) float64
        The boxes' corners.
    axis : (n,) int64
        Along which axis it is cut in half; -1 for a leaf.
    child : (n,) int64
        The lower half; the upper half is the next. Not to be read of a leaf.
    mass : (n,) float64
        Probability.
    """

    low: Array
    high: Array
    axis: Indices
    child: Indices
    mass: Array

    @property
    def leaves(self) -> Indices:
        """Which nodes are leaves."""
        return np.flatnonzero(self.axis < 0)

    @property
    def cut(self) -> Array:
        """Coordinate at which each node is cut, (n,); not to be read of a leaf."""
        rows, along = np.arange(self.axis.size), np.maximum(self.axis, 0)
        return 0.5 * (self.low[rows, along] + self.high[rows, along])


def root(sides: Sides) -> TreeNodes:
    """Make the tree of one leaf that holds everything."""
    return TreeNodes(
        sides.low[None, :].copy(),
        sides.high[None, :].copy(),
        np.full(1, -1, np.int64),
        np.zeros(1, np.int64),
        np.ones(1),
    )


def divide(nodes: TreeNodes, which: Indices, along: Indices) -> TreeNodes:
    """Cut leaves in half, each along its axis; each half gets half the mass.

    The lower half of ``which[m]`` becomes node ``n + 2 m``, the upper the next.
    """
    count, new = nodes.axis.size, 2 * which.size
    low, high = np.repeat(nodes.low[which], 2, axis=0), np.repeat(nodes.high[which], 2, axis=0)
    rows = np.arange(which.size)
    middle = 0.5 * (nodes.low[which, along] + nodes.high[which, along])
    high[2 * rows, along] = middle
    low[2 * rows + 1, along] = middle
    axis, child = nodes.axis.copy(), nodes.child.copy()
    axis[which], child[which] = along, count + 2 * rows
    return TreeNodes(
        np.concatenate([nodes.low, low]),
        np.concatenate([nodes.high, high]),
        np.concatenate([axis, np.full(new, -1, np.int64)]),
        np.concatenate([child, np.zeros(new, np.int64)]),
        np.concatenate([nodes.mass, np.repeat(0.5 * nodes.mass[which], 2)]),
    )


def merged(nodes: TreeNodes, sides: Sides, bound: float) -> TreeNodes:
    """Sum the leaves' masses upwards, and make a leaf of every node whose mass does not exceed ``bound``.

    Unless it would be wider than the coarsest. What is left is laid out level by level.
    """
    axis, mass = nodes.axis.copy(), nodes.mass.copy()
    for level in reversed(_levels(nodes.axis, nodes.child)):
        inner = level[axis[level] >= 0]
        first = nodes.child[inner]
        mass[inner] = mass[first] + mass[first + 1]
        narrow = (nodes.high[inner] - nodes.low[inner] <= sides.coarsest * (1.0 + 1e-9)).all(axis=1)
        whole = (axis[first] < 0) & (axis[first + 1] < 0) & (mass[inner] <= bound) & narrow
        axis[inner[whole]] = -1
    kept = np.concatenate(_levels(axis, nodes.child))
    place = np.zeros(axis.size, np.int64)
    place[kept] = np.arange(kept.size)
    child = np.where(axis[kept] >= 0, place[nodes.child[kept]], 0)
    return TreeNodes(nodes.low[kept], nodes.high[kept], axis[kept], child, mass[kept])


def _levels(axis: Indices, child: Indices) -> list[Indices]:
    """Nodes that can be reached from the root, level by level; halves of one node beside each other."""
    level = np.zeros(1, np.int64)
    levels = [level]
    while (axis[level] >= 0).any():
        first = child[level[axis[level] >= 0]]
        level = np.column_stack([first, first + 1]).reshape(-1)
        levels.append(level)
    return levels
