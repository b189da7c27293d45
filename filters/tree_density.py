"""Density trees: a decomposition that is fine where the probability is (4.1.4 and 4.3.4).

*Probabilistic Robotics*, figure 4.2. A box is cut in half, and its halves again, as long as their probability
exceeds a bound: the less probable a region, the coarser it is represented. The density of a point is found in
as many steps as the tree is deep, the logarithm of the number of leaves when it is balanced.
The filter over such a tree is :class:`filters.density_tree.DensityTreeFilter`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from filters.density.protocol import DensityMoments
from filters.grid import Array, Indices, box_moments, checked_points
from filters.kernels import density_tree as kernels
from filters.tree_nodes import Side, Sides, TreeNodes, divide, merged, root


class DensityTree:
    """A density that is constant in each leaf of a tree; it is never changed.

    Parameters
    ----------
    sides : Sides
        The box that is divided.
    nodes : TreeNodes
        Its nodes; the leaves' masses sum to one.
    """

    def __init__(self, sides: Sides, nodes: TreeNodes) -> None:
        self.sides = sides
        self.nodes = nodes
        self._leaves = nodes.leaves
        self._cut = nodes.cut
        self._low, self._high = nodes.low[self._leaves], nodes.high[self._leaves]
        self._volumes: Array = (nodes.high - nodes.low).prod(axis=1)

    @classmethod
    def uniform(cls, sides: Sequence[Side]) -> DensityTree:
        """Make the tree that knows nothing: one leaf, or as many as are not wider than the coarsest."""
        box = Sides(sides)
        nodes = root(box)
        fresh = nodes.leaves
        while fresh.size:
            along = box.axes_to_cut(nodes.high[fresh] - nodes.low[fresh], np.zeros(fresh.size, np.bool_))
            first = nodes.axis.size
            nodes = divide(nodes, fresh[along >= 0], along[along >= 0])
            fresh = np.arange(first, nodes.axis.size)
        return cls(box, nodes)

    @classmethod
    def of_particles(
        cls, sides: Sequence[Side], points: ArrayLike, bound: float, weights: ArrayLike | None = None
    ) -> DensityTree:
        """Extract the density of a weighted particle set (4.3.4).

        Parameters
        ----------
        sides : sequence of Side
            The box that is divided.
        points : (n, dimension) array
            The particles; those outside the box do not count.
        bound : float
            Boxes with a larger share of the weight are split, in (0, 1).
        weights : (n,) array, optional
            Not negative, up to a common factor; equal if not given.

        Raises
        ------
        ValueError
            Shapes that do not fit, numbers that are not finite, negative weights, no weight in the box, or a
            bound outside (0, 1).
        """
        box, _ = Sides(sides), checked_bound(bound)
        folded = box.folded(checked_points("density tree", points, box.dimension))
        masses = _checked_weights(weights, len(folded))
        inside = box.inside(folded)
        folded, masses = folded[inside], masses[inside]
        total = float(masses.sum())
        if total <= 0.0:
            raise ValueError("density tree: no particle with a positive weight lies in the box")
        masses = masses / total
        nodes = root(box)
        fresh, home = nodes.leaves, np.zeros(masses.size, np.int64)
        while True:
            along = box.axes_to_cut(nodes.high[fresh] - nodes.low[fresh], nodes.mass[fresh] > bound)
            split, along = fresh[along >= 0], along[along >= 0]
            if split.size == 0:
                return cls(box, merged(nodes, box, bound))
            count = nodes.axis.size
            nodes = divide(nodes, split, along)
            cut, rows = nodes.cut, np.arange(home.size)
            moving = nodes.axis[home] >= 0
            rows, folded, masses, home = rows[moving], folded[moving], masses[moving], home[moving]
            rows = np.arange(home.size)
            home = nodes.child[home] + (folded[rows, nodes.axis[home]] >= cut[home])
            fresh = np.arange(count, nodes.axis.size)
            nodes.mass[fresh] = np.bincount(home, masses, nodes.axis.size)[fresh]

    @property
    def leaf_count(self) -> int:
        """How many leaves there are."""
        return self._leaves.size

    @property
    def depth(self) -> int:
        """Steps from the root to the farthest leaf."""
        depth = np.zeros(self.nodes.axis.size, np.int64)
        for node in np.flatnonzero(self.nodes.axis >= 0):
            depth[self.nodes.child[node] : self.nodes.child[node] + 2] = depth[node] + 1
        return int(depth.max())

    @property
    def leaf_boxes(self) -> tuple[Array, Array, Array]:
        """The leaves' lower corners and upper corners, (n, dimension), and probabilities, (n,)."""
        return self._low, self._high, self.nodes.mass[self._leaves]

    def leaf_of(self, points: ArrayLike) -> Indices:
        """Find the node that is the leaf of each point, (n,); -1 outside the box.

        Raises
        ------
        ValueError
            Points of another shape, or not finite.
        """
        given = self.sides.folded(checked_points("density tree", points, self.sides.dimension))
        leaf = np.where(self.sides.inside(given), 0, -1)
        kernels.find(np.ascontiguousarray(given), self.nodes.axis, self._cut, self.nodes.child, leaf)
        return leaf

    def evaluate(self, points: ArrayLike) -> Array:
        """Density at points, (n, dimension), by equation 4.2; 0 outside the box.

        Raises
        ------
        ValueError
            Points of another shape, or not finite.
        """
        leaf = self.leaf_of(points)
        return np.where(leaf < 0, 0.0, self.nodes.mass[leaf] / self._volumes[leaf])

    def draw(self, count: int, generator: np.random.Generator) -> Array:
        """Draw states, (count, dimension): a leaf by its probability, then uniformly in it.

        Raises
        ------
        ValueError
            A negative count.
        """
        if count < 0:
            raise ValueError(f"density tree: count must not be negative, got {count}")
        low, high, mass = self.leaf_boxes
        cumulative: Array = mass.cumsum()
        uniform = generator.random(count) * cumulative[-1]
        chosen = cast(Indices, cumulative.searchsorted(uniform, side="right"))
        return low[chosen] + generator.random((count, self.sides.dimension)) * (high[chosen] - low[chosen])

    def moments(self) -> DensityMoments:
        """Mean and covariance of the density; circular along sides that wrap."""
        low, high, mass = self.leaf_boxes
        return box_moments(list(0.5 * (low + high).T), list((high - low).T), mass, self.sides.periods)


def checked_bound(bound: float) -> float:
    """Return the bound of a leaf's probability.

    Raises
    ------
    ValueError
        Outside (0, 1).
    """
    if not 0.0 < bound < 1.0:
        raise ValueError(f"density tree: bound must lie in (0, 1), got {bound}")
    return bound


def _checked_weights(weights: ArrayLike | None, count: int) -> Array:
    if weights is None:
        return np.ones(count)
    given = np.asarray(weights, np.float64)
    if given.shape != (count,) or not np.isfinite(given).all() or (given < 0.0).any():
        raise ValueError(
            f"density tree: {count} weights are needed, finite and not negative, got shape {given.shape}"
        )
    return given
