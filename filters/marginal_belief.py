"""Particles with a Gaussian each, which share one covariance: what they say, and how they are drawn anew.

The lower layer of :class:`filters.marginal.MarginalFilter`; nothing here moves or weighs a particle.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from filters import resampling
from filters.kalman import Matrix, checked_gaussian, symmetric
from filters.kernels import random, weights
from filters.kernels.compile import Float32Array
from filters.kernels.resampling import RUN, deal
from filters.particle_checks import check_columns
from filters.particle_set import ParticleSet

_RESAMPLING_STREAM = 1 << 32


class MixedMoments(NamedTuple):
    """First and second moments of the whole state.

    Attributes
    ----------
    names : tuple of str
        Nonlinear dimensions, then linear ones.
    mean : (n,) float64
        Weighted; circular for angles.
    covariance : (n, n) float64
        Spread of the particles, plus P among the linear dimensions.
    effective_sample_size : float
        One over the sum of the squared normalised weights.
    """

    names: tuple[str, ...]
    mean: Matrix
    covariance: Matrix
    effective_sample_size: float


class MarginalBelief:
    """Particles of the nonlinear states, each with a mean of the linear ones, whose covariance is common.

    Parameters
    ----------
    nonlinear, linear : sequence of str
        The dimensions.
    angles : sequence of int
        Which of the dimensions are angles.
    capacity : int
        Most particles that there can be; allocated here, once.
    seed : int
        Of the random numbers.
    block : int
        Particles that are worked on at a time.

    Attributes
    ----------
    covariance : (l, l) float64
        P, of the linear states given any particle's path.
    collapses : int
        How often no particle could explain what was measured.

    Raises
    ------
    ValueError
        A capacity or block below 1, no dimensions, or a name that occurs twice.
    """

    def __init__(
        self,
        nonlinear: Sequence[str],
        linear: Sequence[str],
        angles: Sequence[int],
        capacity: int,
        seed: int,
        block: int,
    ) -> None:
        if capacity < 1 or block < 1:
            raise ValueError(
                f"marginal filter: capacity and block must be at least 1, got {capacity} and {block}"
            )
        self.names = (*nonlinear, *linear)
        if not self.names or len(set(self.names)) < len(self.names):
            raise ValueError(f"marginal filter: different names are needed, got ({', '.join(self.names)})")
        self._sampled = len(nonlinear)
        self._angles = tuple(angles)
        self._seed = seed
        self._block = min(block, capacity)
        self._draws = 0
        self._particles = ParticleSet(self.names, capacity)
        self._spare: Float32Array = np.zeros_like(self._particles.columns)
        self._weights: Float32Array = np.zeros(capacity, np.float32)
        self._bounds: list[tuple[int, int]] = []
        self._sums = np.zeros(2)
        self.covariance: Matrix = np.zeros((len(linear), len(linear)))
        self.collapses = 0

    @property
    def count(self) -> int:
        """How many particles there are; 0 before :meth:`initialize`."""
        return self._particles.count

    @property
    def effective_sample_size(self) -> float:
        """1 / Σ w² of the normalised weights (eq. 4.36)."""
        return float(self._sums[0] ** 2 / self._sums[1])

    @property
    def weights(self) -> Float32Array:
        """View of the weights, (count,) float32, relative to the largest."""
        return self._weights[: self.count]

    def column(self, name: str) -> Float32Array:
        """View of one dimension, (count,) float32: samples of a nonlinear one, means of a linear one.

        It is valid until the next :meth:`resample`.

        Raises
        ------
        KeyError
            There is no dimension of that name.
        """
        return self._particles.columns[self._particles.row(name), : self.count]

    def initialize(self, columns: Mapping[str, ArrayLike], covariance: ArrayLike) -> None:
        """Start from given particles, equally weighted.

        Parameters
        ----------
        columns : mapping of str to (count,) array or a number
            Every dimension by name; a number stands for all particles, and one at least must be an array.
        covariance : (l, l) array
            P, of the linear states about each particle's means.

        Raises
        ------
        ValueError
            A dimension missing or unknown, lengths that differ, a length of 0 or above the capacity, a value that
            is not finite, or a covariance that is none.
        """
        if set(columns) != set(self.names):
            raise ValueError(f"initialize: columns must be {', '.join(self.names)}, got {', '.join(columns)}")
        given = np.broadcast_arrays(*(np.asarray(columns[name], np.float64) for name in self.names))
        count = check_columns(
            "initialize", dict(zip(self.names, given, strict=True)), self._particles.capacity
        )
        linear = len(self.names) - self._sampled
        spread = np.array(covariance, np.float64).reshape(np.shape(covariance) if linear else (0, 0))
        self.covariance = checked_gaussian("initialize", np.zeros(linear), spread).covariance
        self._particles.columns[:, :count] = given
        self._recount(count)
        self._level()

    def moments(self) -> MixedMoments:
        """Say mean and covariance of the whole state."""
        values = self._particles.columns[:, : self.count].astype(np.float64)
        share = self.weights.astype(np.float64)
        share /= share.sum()
        mean = values @ share
        for k in self._angles:
            mean[k] = math.atan2(np.sin(values[k]) @ share, np.cos(values[k]) @ share)
        offsets = values - mean[:, None]
        for k in self._angles:
            offsets[k] = np.remainder(offsets[k] + math.pi, 2.0 * math.pi) - math.pi
        # an angle's circular mean is not the mean of its offsets; for the rest it is rounding
        away = offsets @ share
        covariance = (offsets * share) @ offsets.T - np.outer(away, away)
        covariance[self._sampled :, self._sampled :] += self.covariance
        return MixedMoments(self.names, mean, symmetric(covariance), self.effective_sample_size)

    def resample(self, count: int | None = None) -> None:
        """Draw ``count`` particles by Table 4.4, equally weighted; as many as now by default.

        Raises
        ------
        ValueError
            A count below 1 or above the capacity.
        """
        target = self.count if count is None else count
        if not 1 <= target <= self._particles.capacity:
            raise ValueError(
                f"resample: count must lie in 1 to {self._particles.capacity} (the capacity), got {target}"
            )
        self._draws += 1
        uniform = random.uniform(self._seed, _RESAMPLING_STREAM, self._draws)
        ancestors = resampling.systematic(self.weights, target, uniform)
        columns = self._particles.columns
        whole = np.array((0, target))  # in one block: copies stay in the order of their ancestors
        deal(columns, self._spare, ancestors, whole, 0, -(-target // RUN))
        self._particles.columns, self._spare = self._spare, columns
        self._recount(target)
        self._level()

    def _normalize(self, constant: float) -> float:
        """Make weights of the log weights; return the log of the mean likelihood, with its constant."""
        before = self._sums[0]
        logs = self._particles.log_weights
        starts = np.array([*(first for first, _ in self._bounds), self.count])
        rows = np.zeros((len(self._bounds), 2))
        top, total, squares = weights.normalize(logs, self._weights, starts, rows)
        if not total > 0.0:
            self.collapses += 1
            self._level()
            return -math.inf
        self._sums = np.array((total, squares))
        return constant + top + math.log(total / before)

    def _level(self) -> None:
        """Make all weights equal."""
        self._particles.log_weights[: self.count] = 0.0
        self._weights[: self.count] = 1.0
        self._sums = np.full(2, float(self.count))

    def _recount(self, count: int) -> None:
        self._particles.count = count
        self._bounds = list(pairwise([*range(0, count, self._block), count]))
