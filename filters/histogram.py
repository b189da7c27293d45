"""The histogram filter: a belief constant in each cell of a static grid.

*Probabilistic Robotics*, 4.1.2 to 4.1.4. The discrete Bayes filter of Table 4.1 over the cells of a continuous
space (eq. 4.1), the density in a cell being its probability over its volume (eq. 4.2). What a cell stands for
in the motion and measurement models is said by the rule for cells that the filter is made with: its mean
state (eq. 4.3 to 4.5) or the exact integrals (eq. 4.6 to 4.10), see :mod:`filters.cells`.

Selective updating (4.1.4): only cells likelier than a share of the likeliest are moved and weighed. All others
are one large region that stays where it is and is weighed as one, by the mean likelihood over a sample of it:
if the measurements begin to speak for it, its cells rise over the threshold again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from filters.cells import CellMean, Cells, log_mean
from filters.density.protocol import DensityMoments
from filters.grid import MOST_AXES, Array, Columns, Grid, Indices, LogDensity, box_moments
from filters.kernels import histogram as kernels

Move = Callable[[Columns], Sequence[ArrayLike]]
"""Where states move without noise: columns in, columns out; what is returned broadcasts against the states."""

TAIL = 7.0
"""Standard deviations of the motion's noise that are followed; beyond lie 3e-12, dealt to the cells within."""

BLOCK = 16_384
REST_SAMPLE = 4_096
_SMALLEST = 1e-200


class HistogramFilter:
    """A belief over a grid; uniform at the start.

    Parameters
    ----------
    grid : Grid
        The decomposition.
    cells : Cells
        What a cell stands for; its mean state if not given.
    share : float
        Selective updating: cells of at most this share of the largest probability are not moved nor weighed
        one by one. 0 moves and weighs every cell.

    Attributes
    ----------
    departed : float
        Share of the belief that has left the grid since the start, by all predictions together.
    touched : int
        How many cells the last prediction or update has moved or weighed.

    Raises
    ------
    ValueError
        A share outside [0, 1).
    """

    def __init__(self, grid: Grid, cells: Cells | None = None, share: float = 0.0) -> None:
        if not 0.0 <= share < 1.0:
            raise ValueError(f"histogram filter: share must lie in [0, 1), got {share}")
        self.grid = grid
        self.share = share
        self.departed = 0.0
        self.touched = 0
        self._cells = CellMean() if cells is None else cells
        self._nodes = self._cells.nodes(grid.dimension)
        self._belief: Array = np.full(grid.shape, 1.0 / grid.size)
        self._spare: Array = np.empty(grid.shape)
        self._every: Indices = np.arange(grid.size)
        golden = 0.5 * (math.sqrt(5.0) - 1.0)
        spaced = np.mod(np.arange(1, min(REST_SAMPLE, grid.size) + 1) * golden, 1.0)
        self._sample: Indices = np.unique((spaced * grid.size).astype(np.int64))

    @property
    def belief(self) -> Array:
        """Probability of each cell, of the grid's shape; sums to one. A view that cannot be written to."""
        view = self._belief.view()
        view.flags.writeable = False
        return view

    def reset(self, probabilities: ArrayLike) -> None:
        """Start again from probabilities of the cells, up to a common factor.

        Raises
        ------
        ValueError
            Another shape, a number negative or not finite, or all zero; the belief is unchanged then.
        """
        given = np.array(probabilities, np.float64)
        if given.shape != self.grid.shape:
            raise ValueError(f"histogram filter: {self.grid.shape} probabilities needed, got {given.shape}")
        total = float(given.sum())
        if not 0.0 < total < math.inf or (given < 0.0).any():
            raise ValueError(
                "histogram filter: probabilities must be finite, not negative and not all zero, got "
                f"numbers from {given.min()} to {given.max()}"
            )
        self._belief = given / total
        self.departed = 0.0

    def initialize(self, log_density: LogDensity) -> None:
        """Start again from a density, known up to a factor, by the rule for cells.

        Raises
        ------
        ValueError
            As :meth:`update`, or a density of zero everywhere; the belief is unchanged then.
        """
        logs = log_mean(log_density, self.grid.states(), self.grid.widths, self._nodes)
        top = float(logs.max())
        if top == -math.inf:
            raise ValueError("histogram filter: the density is zero in every cell")
        self.reset(np.broadcast_to(np.exp(logs - top), self.grid.shape))

    # --- motion, line 3 of Table 4.1 ----------------------------------------------------------------------------

    def predict(self, move: Move, sigma: ArrayLike) -> float:
        """Move the belief: state = move(state) + Gaussian noise, independent along the axes.

        Where the rule has one node for a cell and the axes can be ordered so that none is moved by one moved
        before it, they are moved one after the other, which costs the sum of their windows in place of the
        product; the result is the same. Of a selective filter only the chosen cells are moved.

        Parameters
        ----------
        move : callable
            Takes the states as columns, one array for each axis, and returns them as they are without noise.
        sigma : (dimension,) array
            Standard deviation of the noise along each axis; 0 for none.

        Returns
        -------
        float
            Share of the belief that left the grid; the rest is normalised. 1 if all of it did: the belief is
            kept then, as where it went cannot be said.

        Raises
        ------
        ValueError
            A sigma negative or not finite, or a motion that gives a number that is not finite or another
            number of columns; the belief is unchanged then.
        """
        sigmas = self._checked_sigma(sigma)
        chosen = self._chosen()
        reach = np.array([self._window(k, sigma) for k, sigma in enumerate(sigmas)])
        moved = self._moved(move, self.grid.states()) if len(self._nodes.weights) == 1 else []
        order = _order(moved)
        if order and reach.sum() * self.grid.size <= reach.prod() * chosen.size:
            target, departed = self._move_by_axes(moved, order, sigmas, chosen)
        else:
            target, departed = self._move_by_cells(move, sigmas, chosen)
        self.touched = chosen.size
        total = float(target.sum())
        if total <= _SMALLEST:
            return 1.0
        np.divide(target, total, out=target)
        self._belief = target
        self.departed += (1.0 - self.departed) * departed
        return departed

    def _move_by_axes(
        self, moved: list[Array], order: list[int], sigmas: Array, chosen: Indices
    ) -> tuple[Array, float]:
        """Move along one axis after the other.

        The array is laid out anew for each: first the axes that steer it, then itself, then the rest, which
        all move alike.
        """
        source, rest = self._belief, None
        if chosen.size < self.grid.size:
            rest = self._belief.copy()
            rest.reshape(-1)[chosen] = 0.0
            source = self._belief - rest
        departed = 0.0
        layout = list(range(self.grid.dimension))
        for axis in order:
            steering = [k for k in layout if k != axis and moved[axis].shape[k] > 1]
            wanted = [*steering, axis, *(k for k in layout if k != axis and k not in steering)]
            source = np.ascontiguousarray(source.transpose([layout.index(k) for k in wanted]))
            layout = wanted
            source, left = self._move_along(source, layout, axis, moved[axis], float(sigmas[axis]))
            departed += left
        source = np.ascontiguousarray(source.transpose(np.argsort(layout)))
        return (source if rest is None else source + rest), departed

    def _move_along(
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

    def _move_by_cells(self, move: Move, sigmas: Array, chosen: Indices) -> tuple[Array, float]:
        target = self._belief.copy()
        flat = target.reshape(-1)
        flat[chosen] = 0.0
        masses = self._belief.reshape(-1)[chosen]
        departed = 0.0
        for first in range(0, chosen.size, BLOCK):
            block = slice(first, first + BLOCK)
            centres = self.grid.states_at(chosen[block])
            for offset, weight in zip(*self._nodes, strict=True):
                steps = offset * self.grid.widths
                moved = self._moved(move, [c + step for c, step in zip(centres, steps, strict=True)])
                windows: list[NDArray[np.generic]] = []
                for axis in range(MOST_AXES):
                    windows += self._flat_targets(axis, moved, sigmas, masses[block].size)
                departed += kernels.scatter(weight * masses[block], *windows, flat)
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
        return 2 * math.ceil(TAIL * sigma / self.grid.axes[axis].width) + 1

    def _moved(self, move: Move, states: list[Array]) -> list[Array]:
        moved = [np.asarray(column, np.float64) for column in move(states)]
        shape = np.broadcast_shapes(*(state.shape for state in states))
        if len(moved) != self.grid.dimension:
            raise ValueError(f"histogram motion: {self.grid.dimension} columns are needed, got {len(moved)}")
        for column in moved:
            if np.broadcast_shapes(column.shape, shape) != shape:
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

    # --- measurement, line 4 of Table 4.1 -----------------------------------------------------------------------

    def update(self, log_likelihood: LogDensity) -> float:
        """Weigh every cell by the likelihood of a measurement, and normalise.

        Parameters
        ----------
        log_likelihood : callable
            Takes the states as columns, one array for each axis, that broadcast against each other; returns
            log p(z | state), which may vary along some of the axes only. Vectorised: called once for each
            node of the rule for cells.

        Returns
        -------
        float
            Logarithm of the evidence p(z | what was before). Minus infinity if no cell can explain the
            measurement: the belief is kept then.

        Raises
        ------
        ValueError
            NaN or plus infinity among the log likelihoods, or a shape that does not fit; the belief is
            unchanged then.
        """
        chosen = self._chosen()
        if chosen.size == self.grid.size:
            return self._weigh_all(log_likelihood)
        return self._weigh_chosen(log_likelihood, chosen)

    def _weigh_all(self, log_likelihood: LogDensity) -> float:
        logs = log_mean(log_likelihood, self.grid.states(), self.grid.widths, self._nodes)
        logs = logs.reshape((1,) * (self.grid.dimension - logs.ndim) + logs.shape)
        self.touched = self.grid.size
        top = float(logs.max())
        if top == -math.inf:
            return -math.inf
        likelihood = np.exp(logs - top)
        alike = tuple(k for k, size in enumerate(logs.shape) if size == 1)
        total = float((self._belief.sum(axis=alike, keepdims=True) * likelihood).sum())
        if total > _SMALLEST:
            np.multiply(self._belief, likelihood / total, out=self._spare)
        else:  # what is likely now was all but impossible before
            with np.errstate(divide="ignore"):
                weighed = np.log(self._belief) + (logs - top)
            highest = float(weighed.max())
            if highest == -math.inf:
                return -math.inf
            np.exp(weighed - highest, out=self._spare)
            top, total = top + highest, float(self._spare.sum())
            np.divide(self._spare, total, out=self._spare)
        self._belief, self._spare = self._spare, self._belief
        return top + math.log(total)

    def _weigh_chosen(self, log_likelihood: LogDensity, chosen: Indices) -> float:
        flat = self._belief.reshape(-1)
        masses = flat[chosen]
        sampled = self._sample[flat[self._sample] <= masses.min()]
        logs = self._log_likelihoods(log_likelihood, chosen)
        rest_logs = self._log_likelihoods(log_likelihood, sampled)
        self.touched = chosen.size + sampled.size
        top = max(float(logs.max()), float(rest_logs.max(initial=-math.inf)))
        if top == -math.inf:
            return -math.inf
        weighed = masses * np.exp(logs - top)
        rest = max(0.0, 1.0 - float(masses.sum()))
        stands_for = flat[sampled]
        known = float(stands_for.sum())
        factor = float(stands_for @ np.exp(rest_logs - top)) / known if known > 0.0 else 1.0
        total = float(weighed.sum()) + factor * rest
        if total <= _SMALLEST:
            return self._weigh_all(log_likelihood)
        np.multiply(self._belief, factor / total, out=self._spare)
        self._spare.reshape(-1)[chosen] = weighed / total
        self._belief, self._spare = self._spare, self._belief
        return top + math.log(total)

    def _log_likelihoods(self, log_likelihood: LogDensity, cells: Indices) -> Array:
        if cells.size == 0:
            return np.empty(0)
        logs = log_mean(log_likelihood, self.grid.states_at(cells), self.grid.widths, self._nodes)
        return np.broadcast_to(logs, cells.shape)

    def _chosen(self) -> Indices:
        """Flat indices of the cells that are moved and weighed one by one."""
        if self.share == 0.0:
            return self._every
        return np.flatnonzero(self._belief > self.share * self._belief.max())

    # --- what the belief says -----------------------------------------------------------------------------------

    def evaluate(self, points: ArrayLike) -> Array:
        """Density at points, (n, dimension), by equation 4.2; 0 outside the grid.

        Raises
        ------
        ValueError
            Points of another shape, or not finite.
        """
        cells = self.grid.cell_of(points)
        density = self._belief.reshape(-1)[np.maximum(cells, 0)] / self.grid.volume
        return np.where(cells < 0, 0.0, density)

    def draw(self, count: int, generator: np.random.Generator) -> Array:
        """Draw states, (count, dimension): a cell by its probability, then uniformly in it.

        Raises
        ------
        ValueError
            A negative count.
        """
        if count < 0:
            raise ValueError(f"histogram filter: count must not be negative, got {count}")
        cumulative = self._belief.cumsum()
        cells = np.searchsorted(cumulative, generator.random(count) * cumulative[-1], side="right")
        within = generator.random((count, self.grid.dimension)) - 0.5
        return np.column_stack(self.grid.states_at(cells)) + within * self.grid.widths

    def moments(self) -> DensityMoments:
        """Mean and covariance of the density; circular along axes that wrap.

        See :func:`filters.grid.box_moments`.
        """
        cells = np.flatnonzero(self._belief)
        centres = self.grid.states_at(cells)
        widths = [np.broadcast_to(width, cells.shape) for width in self.grid.widths]
        periods = [axis.high - axis.low if axis.wraps else math.inf for axis in self.grid.axes]
        return box_moments(centres, widths, self._belief.reshape(-1)[cells], np.array(periods))

    @property
    def most_likely(self) -> Array:
        """Mean state of the likeliest cell, (dimension,); the first of them if several are equal."""
        return np.concatenate(self.grid.states_at(np.array([int(self._belief.argmax())])))

    def marginal(self, axes: Sequence[int]) -> Array:
        """Probabilities over some of the axes, in the order of the grid.

        Raises
        ------
        ValueError
            There is no such axis.
        """
        kept = set(axes)
        if not kept <= set(range(self.grid.dimension)):
            raise ValueError(
                f"histogram filter: axes must be among 0 to {self.grid.dimension - 1}, got {tuple(axes)}"
            )
        return self._belief.sum(axis=tuple(k for k in range(self.grid.dimension) if k not in kept))


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
