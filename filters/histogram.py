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
from collections.abc import Sequence
from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from filters.cells import CellMean, Cells, log_mean
from filters.density.protocol import DensityMoments
from filters.grid import Array, Grid, Indices, LogDensity, box_moments
from filters.grid_motion import GridMotion, Move

REST_SAMPLE = 1_024
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
        rule = CellMean() if cells is None else cells
        self._motion = GridMotion(grid, rule)
        self._nodes = rule.nodes(grid.dimension)
        self._belief: Array = np.full(grid.shape, 1.0 / grid.size)
        self._spare: Array = np.empty(grid.shape)
        self._every: Indices = np.arange(grid.size)
        self._sample: Indices = self._every
        if grid.size > REST_SAMPLE:  # spaced by the golden ratio, so that no axis is sampled in step
            turns = np.arange(1, REST_SAMPLE + 1) * (0.5 * (math.sqrt(5.0) - 1.0))
            self._sample = np.unique((np.mod(turns, 1.0) * grid.size).astype(np.int64))

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

        Of a selective filter only the chosen cells are moved. See :class:`filters.grid_motion.GridMotion`.

        Parameters
        ----------
        move : callable
            Takes the states as columns, one array for each axis that broadcast against each other; returns
            them as they are without noise.
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
            A sigma negative or not finite, or a motion that gives a number that is not finite or columns that
            do not fit; the belief is unchanged then.
        """
        chosen = self._chosen()
        target, departed = self._motion.carry(self._belief, chosen, move, sigma)
        self.touched = chosen.size
        total = float(target.sum())
        if total <= _SMALLEST:
            return 1.0
        np.divide(target, total, out=target)
        self._belief = target
        self.departed += (1.0 - self.departed) * departed
        return departed

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
        sampled = self._sample[flat[self._sample] <= self._threshold()]
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
        return np.flatnonzero(self._belief > self._threshold())

    def _threshold(self) -> float:
        return self.share * float(self._belief.max())

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
        cumulative: Array = self._belief.cumsum()
        uniform = generator.random(count) * cumulative[-1]
        cells = cast(Indices, cumulative.searchsorted(uniform, side="right"))
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
