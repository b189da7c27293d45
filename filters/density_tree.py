"""Density trees: a decomposition that is fine where the probability is (4.1.4 and 4.3.4).

*Probabilistic Robotics*, figure 4.2. A box is cut in half, and its halves again, as long as their probability
exceeds a bound: the less probable a region, the coarser it is represented. The density of a point is found in
as many steps as the tree is deep, the logarithm of the number of leaves when it is balanced.

:class:`DensityTree` is such a density, made of a weighted particle set or by the filter.
:class:`DensityTreeFilter` is the histogram filter over its leaves, which are split and merged as the belief
moves: a leaf whose probability exceeds the bound is split, two whose sum does not exceed it are merged.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from filters.cells import CellIntegral, Cells, log_mean
from filters.density.protocol import DensityMoments
from filters.grid import Array, Indices, LogDensity, box_moments, checked_points
from filters.histogram import Move
from filters.kernels import density_tree as kernels
from filters.tree_motion import carried
from filters.tree_nodes import Side, Sides, TreeNodes, divide, merged, root

__all__ = ["DensityTree", "DensityTreeFilter", "Side"]


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
        box, _ = Sides(sides), _checked_bound(bound)
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
        cumulative = mass.cumsum()
        chosen = np.searchsorted(cumulative, generator.random(count) * cumulative[-1], side="right")
        return low[chosen] + generator.random((count, self.sides.dimension)) * (high[chosen] - low[chosen])

    def moments(self) -> DensityMoments:
        """Mean and covariance of the density; circular along sides that wrap."""
        low, high, mass = self.leaf_boxes
        return box_moments(list(0.5 * (low + high).T), list((high - low).T), mass, self.sides.periods)


class DensityTreeFilter:
    """A belief that is a density tree; uniform at the start.

    Parameters
    ----------
    sides : sequence of Side
        The box that is divided, and how finely it may be.
    bound : float
        Probability above which a leaf is split, in (0, 1); there are then at least ``1 / bound`` leaves, and
        usually less than three times as many.
    cells : Cells
        Where a leaf's likelihood is looked at; if not given, its integral by two points along each axis. A
        likelihood so narrow that it falls between the points of a leaf is missed there: the coarsest widths
        of the sides are the guard against it.

    Attributes
    ----------
    departed : float
        Share of the belief that has left the box since the start, by all predictions together.

    Raises
    ------
    ValueError
        No side, or a bound outside (0, 1).
    """

    def __init__(self, sides: Sequence[Side], bound: float, cells: Cells | None = None) -> None:
        self.bound = _checked_bound(bound)
        self.departed = 0.0
        self._given = tuple(sides)
        self._tree = DensityTree.uniform(sides)
        self._nodes = (CellIntegral(2) if cells is None else cells).nodes(len(sides))

    @property
    def tree(self) -> DensityTree:
        """The belief as a density: evaluate it, draw from it, ask for its moments."""
        return self._tree

    def initialize(self, log_density: LogDensity) -> None:
        """Start again from a density, known up to a factor.

        Raises
        ------
        ValueError
            As :meth:`update`, or a density of zero everywhere; the belief is unchanged then.
        """
        before, self._tree = self._tree, DensityTree.uniform(self._given)
        done = False
        try:
            done = self.update(log_density) > -math.inf
        finally:
            if not done:
                self._tree = before
        if not done:
            raise ValueError("density tree filter: the density is zero in every leaf")
        self.departed = 0.0

    def predict(self, move: Move, sigma: ArrayLike) -> float:
        """Move the belief: state = move(state) + Gaussian noise, independent along the axes.

        Every leaf is carried as a box, stretched as the motion stretches it and blurred by the noise; a leaf
        over which the motion varies too much is carried in parts. The new tree grows around them, the
        probability of each of its boxes being exact for these (eq. 4.9).

        Parameters
        ----------
        move : callable
            Takes the states as columns, one array for each axis, and returns them as they are without noise.
        sigma : (dimension,) array
            Standard deviation of the noise along each axis; 0 for none.

        Returns
        -------
        float
            Share of the belief that left the box; the rest is normalised. 1 if all of it did: the belief is
            kept then.

        Raises
        ------
        ValueError
            A sigma negative or not finite, or a motion that gives a number that is not finite or another
            shape; the belief is unchanged then.
        """
        nodes = carried(self._tree.sides, self._tree.leaf_boxes, move, sigma, self.bound)
        staying = float(nodes.mass[0])
        if staying <= 1e-200:
            return 1.0
        masses = np.where(nodes.axis < 0, nodes.mass, 0.0)
        scaled = nodes._replace(mass=masses / masses.sum())
        self._tree = DensityTree(self._tree.sides, merged(scaled, self._tree.sides, self.bound))
        departed = max(0.0, 1.0 - staying)
        self.departed += (1.0 - self.departed) * departed
        return departed

    def update(self, log_likelihood: LogDensity) -> float:
        """Weigh the belief by the likelihood of a measurement, split and merge, and normalise.

        A leaf is split before it is weighed as long as it might exceed the bound with the largest likelihood
        seen in it. Each leaf's likelihood is its mean over the leaf (eq. 4.6).

        Parameters
        ----------
        log_likelihood : callable
            Takes the states as columns, one array (n,) for each axis; returns log p(z | state), (n,).

        Returns
        -------
        float
            Logarithm of the evidence p(z | what was before). Minus infinity if no leaf can explain the
            measurement: the belief is kept then.

        Raises
        ------
        ValueError
            NaN or plus infinity among the log likelihoods, or a shape that does not fit; the belief is
            unchanged then.
        """
        sides, nodes = self._tree.sides, self._tree.nodes
        logs, peaks = np.full(nodes.axis.size, -math.inf), np.full(nodes.axis.size, -math.inf)
        fresh = nodes.leaves
        while True:
            logs[fresh], peaks[fresh] = self._likelihoods(log_likelihood, nodes, fresh)
            leaves = nodes.leaves
            with np.errstate(divide="ignore"):
                prior = np.log(nodes.mass[leaves])
            weighed = prior + logs[leaves]
            top = float(weighed.max())
            if top == -math.inf:
                return -math.inf
            evidence = top + math.log(float(np.exp(weighed - top).sum()))
            heavy = prior + peaks[leaves] > math.log(self.bound) + evidence
            along = sides.axes_to_cut(nodes.high[leaves] - nodes.low[leaves], heavy)
            if (along < 0).all():
                break
            first = nodes.axis.size
            nodes = divide(nodes, leaves[along >= 0], along[along >= 0])
            fresh = np.arange(first, nodes.axis.size)
            room = np.full(fresh.size, -math.inf)
            logs, peaks = np.concatenate([logs, room]), np.concatenate([peaks, room])
        mass = np.zeros(nodes.axis.size)
        mass[leaves] = np.exp(weighed - evidence)
        self._tree = DensityTree(sides, merged(nodes._replace(mass=mass), sides, self.bound))
        return evidence

    def _likelihoods(
        self, log_likelihood: LogDensity, nodes: TreeNodes, which: Indices
    ) -> tuple[Array, Array]:
        """Logarithms of the mean and of the largest likelihood in boxes, as seen at the rule's points."""
        low, high = nodes.low[which], nodes.high[which]
        centres, widths = list(0.5 * (low + high).T), list((high - low).T)
        seen: list[Array] = []

        def remembered(states: Sequence[Array]) -> ArrayLike:
            seen.append(np.asarray(log_likelihood(states), np.float64))
            return seen[-1]

        mean = log_mean(remembered, centres, widths, self._nodes)
        peak = np.max([np.broadcast_to(logs, which.shape) for logs in seen], axis=0)
        return np.broadcast_to(mean, which.shape), peak


def _checked_bound(bound: float) -> float:
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
