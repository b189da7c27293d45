"""The density-tree filter: a histogram filter whose cells follow the belief (4.1.4).

The leaves of a density tree are its cells. They are split and merged as the belief moves: a leaf whose
probability exceeds a bound is split, two whose sum does not exceed it become one again. So the resolution lies
where the probability is, and the number of leaves stays near the inverse of the bound wherever the belief is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from filters.cells import CellIntegral, Cells, log_mean
from filters.grid import Array, Indices, LogDensity
from filters.grid_motion import Move
from filters.tree_density import DensityTree, checked_bound
from filters.tree_motion import carried
from filters.tree_nodes import Side, TreeNodes, divide, merged

__all__ = ["DensityTree", "DensityTreeFilter", "Side"]


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
        self.bound = checked_bound(bound)
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
