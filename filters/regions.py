"""Topological decomposition: a belief over the regions of a graph, and how it meets the metric one (4.1.4).

A grid's cells are all alike; regions are what the environment makes of itself: rooms, corridors, crossings.
Who is in a region leaves it at random, at a rate of one over the time that the way to each neighbour takes, so
times spent are exponential, which is coarse and needs no memory. Motion and measurement are then the
discrete Bayes filter of Table 4.1.

:class:`Partition` says which region each cell of a grid belongs to. It makes the graph of the regions, sums a
metric belief over them, and spreads a topological one over their cells.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from filters.discrete import DiscreteBayesFilter
from filters.grid import Array, Grid, Indices
from filters.transition import transition_over


class RegionGraph:
    """Regions and the ways between them.

    Parameters
    ----------
    regions : sequence of str
        Their names, all different.
    seconds : mapping of (str, str) to float
        How long the way from a region's middle to a neighbour's takes; each way serves both directions unless
        the opposite one is given too.

    Raises
    ------
    ValueError
        No regions, names that occur twice, a way to or from a region that is not there or to itself, or a time
        that is not positive and finite.
    """

    def __init__(self, regions: Sequence[str], seconds: Mapping[tuple[str, str], float]) -> None:
        self.regions = tuple(regions)
        places = {region: place for place, region in enumerate(self.regions)}
        if not self.regions or len(places) < len(self.regions):
            raise ValueError(f"region graph: at least one region, all different, got {self.regions}")
        rates = np.zeros((len(places), len(places)))
        for (start, end), time in seconds.items():
            if start not in places or end not in places or start == end:
                raise ValueError(
                    f"region graph: a way must lead between two of {self.regions}: {start}, {end}"
                )
            if not 0.0 < time < math.inf:
                raise ValueError(f"region graph: {start} to {end} must take a positive time, got {time} s")
            rates[places[start], places[end]] = 1.0 / time
            if (end, start) not in seconds:
                rates[places[end], places[start]] = 1.0 / time
        self.rates: Array = rates


class TopologicalFilter:
    """A belief over the regions of a graph.

    Parameters
    ----------
    graph : RegionGraph
        Regions and the times between them.
    belief : (n,) array, optional
        Probabilities at the start, up to a common factor; uniform if not given.

    Raises
    ------
    ValueError
        As :class:`filters.discrete.DiscreteBayesFilter`.
    """

    def __init__(self, graph: RegionGraph, belief: ArrayLike | None = None) -> None:
        self.graph = graph
        self._filter = DiscreteBayesFilter(graph.regions, np.eye(len(graph.regions)), belief)

    @property
    def belief(self) -> Array:
        """Probability of each region, (n,), in the order of the graph's."""
        return self._filter.belief

    @property
    def most_likely(self) -> str:
        """Name of the likeliest region."""
        return self._filter.most_likely

    def predict(self, seconds: float) -> None:
        """Let a time pass, on the way.

        Raises
        ------
        ValueError
            A time negative or not finite; the belief is unchanged then.
        """
        self._filter.propagate(transition_over(self.graph.rates, seconds))

    def update(self, log_likelihoods: ArrayLike) -> float:
        """Weigh each region by the logarithm of p(z | region); return the log evidence.

        Raises
        ------
        ValueError
            As :meth:`filters.discrete.DiscreteBayesFilter.update_log`; the belief is unchanged then.
        """
        return self._filter.update_log(log_likelihoods)


class Partition:
    """Which region each cell of a grid belongs to.

    Parameters
    ----------
    grid : Grid
        Whose first axes the labels cover: labels of two axes fit a grid with a heading as its third.
    labels : array of int
        Number of each cell's region, from 0; -1 for cells that belong to none, such as walls.
    regions : sequence of str
        Their names.

    Raises
    ------
    ValueError
        Labels of another shape than the grid's first axes, numbers without a name, or a region without a cell.
    """

    def __init__(self, grid: Grid, labels: ArrayLike, regions: Sequence[str]) -> None:
        given = np.array(labels)
        if given.ndim == 0 or given.shape != grid.shape[: given.ndim]:
            raise ValueError(f"partition: labels of the first of {grid.shape} are needed, got {given.shape}")
        if not np.issubdtype(given.dtype, np.integer) or given.min() < -1 or given.max() >= len(regions):
            raise ValueError(f"partition: labels must be whole numbers from -1 to {len(regions) - 1}")
        self.grid = grid
        self.regions = tuple(regions)
        self._labels: Indices = given.astype(np.int64)
        beyond = grid.size // given.size
        self._counts: Indices = self._sums(np.ones(given.size)).astype(np.int64) * beyond
        if (self._counts == 0).any():
            empty = [name for name, count in zip(regions, self._counts, strict=True) if count == 0]
            raise ValueError(f"partition: every region needs a cell; none have {', '.join(empty)}")

    def graph(self, speed: float) -> RegionGraph:
        """Make the graph: ways between regions whose cells touch, as long as their centroids are apart.

        Raises
        ------
        ValueError
            A speed that is not positive and finite.
        """
        if not 0.0 < speed < math.inf:
            raise ValueError(f"partition: speed must be positive and finite, got {speed}")
        touching: set[tuple[int, int]] = set()
        for k in range(self._labels.ndim):
            pairs = [(self._labels, np.roll(self._labels, -1, axis=k))]
            if not self.grid.axes[k].wraps:
                inner = [slice(None)] * k
                pairs = [(self._labels[(*inner, slice(-1))], self._labels[(*inner, slice(1, None))])]
            for one, other in pairs:
                differ = (one != other) & (one >= 0) & (other >= 0)
                touching |= set(zip(one[differ].tolist(), other[differ].tolist(), strict=True))
        middles = self.centroids
        ways = {
            (self.regions[a], self.regions[b]): math.dist(middles[a], middles[b]) / speed for a, b in touching
        }
        return RegionGraph(self.regions, ways)

    @property
    def centroids(self) -> Array:
        """Mean state of each region's cells, (regions, axes of the labels); axes that wrap are cut open."""
        states = [
            np.broadcast_to(
                axis.centres.reshape([-1 if k == place else 1 for k in range(self._labels.ndim)]),
                self._labels.shape,
            ).reshape(-1)
            for place, axis in enumerate(self.grid.axes[: self._labels.ndim])
        ]
        cells = self._sums(np.ones(self._labels.size))
        return np.column_stack([self._sums(state) / cells for state in states])

    def masses(self, belief: Array) -> Array:
        """Sum a metric belief, of the grid's shape, over each region: (regions,); walls are left out."""
        flat = belief.reshape(self._labels.size, -1).sum(axis=1)
        return self._sums(flat)

    def spread(self, probabilities: ArrayLike) -> Array:
        """Spread a topological belief uniformly over each region's cells; of the grid's shape.

        Raises
        ------
        ValueError
            Not one probability for each region.
        """
        given = np.array(probabilities, np.float64)
        if given.shape != (len(self.regions),):
            raise ValueError(f"partition: {len(self.regions)} probabilities are needed, got {given.shape}")
        each = np.append(given / self._counts, 0.0)[self._labels]
        beyond = self.grid.shape[self._labels.ndim :]
        return np.broadcast_to(each.reshape(each.shape + (1,) * len(beyond)), self.grid.shape).copy()

    def _sums(self, values: Array) -> Array:
        flat = self._labels.reshape(-1)
        sums: Array = np.bincount(flat[flat >= 0], values[flat >= 0], len(self.regions)).astype(np.float64)
        return sums
