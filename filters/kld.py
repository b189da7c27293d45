"""KLD-sampling: how many particles a belief needs.

From Fox, "Adapting the sample size in particle filters through KLD-sampling", IJRR 22(12), 2003. With k
occupied bins, n particles keep the Kullback-Leibler distance between the sample and the belief it stands for
below ``error`` with the given probability, where by the Wilson-Hilferty approximation of chi-square's
quantile

    n = (k - 1) / (2 error) · (1 - 2 / (9 (k - 1)) + sqrt(2 / (9 (k - 1))) z)³

and z is the standard normal *quantile* of the probability (2.326 for 0.99), not the probability.

Fox draws particle by particle until there are as many as the bins touched so far ask for. Systematic resampling
(Table 4.4) must know its count before its first draw, and its ancestors ascend, so bins cannot be counted on the way.
So the two are done one after the other: :meth:`Demand.draws` makes Fox's draws without copying anything, which
gives the count, and the set is then resampled to it.
"""

from __future__ import annotations

import math
from functools import lru_cache
from statistics import NormalDist
from typing import Protocol

import numpy as np

from filters.kernels.bins import draws_until_enough, occupied
from filters.kernels.compile import Float32Array

SAMPLE = 8192
"""Most particles that bins are counted over."""

LIGHT = 0.01
"""Particles below this part of the mean weight are as good as gone at the next resampling."""


@lru_cache(maxsize=32)
def _quantile(probability: float) -> float:
    return NormalDist().inv_cdf(probability)


def bound(bins: int, error: float, quantile_probability: float, minimum: int = 1) -> int:
    """Count how many particles ``bins`` occupied bins need.

    Parameters
    ----------
    bins : int
        Occupied bins, k. For one or none the bound says nothing, and ``minimum`` is returned.
    error : float
        Largest Kullback-Leibler distance, nats.
    quantile_probability : float
        With which it is not exceeded.
    minimum : int
        The least to return.

    Raises
    ------
    ValueError
        An error that is not positive, or a probability outside (0, 1).
    """
    if not 0.0 < error < math.inf or not 0.0 < quantile_probability < 1.0:
        raise ValueError(
            f"KLD bound: error must be positive and probability in (0, 1), got {error} and "
            f"{quantile_probability}"
        )
    if bins <= 1:
        return minimum
    freedom = bins - 1
    ninth = 2.0 / (9.0 * freedom)
    root = 1.0 - ninth + math.sqrt(ninth) * _quantile(quantile_probability)
    return max(minimum, math.ceil(freedom / (2.0 * error) * root**3))


class Weighted(Protocol):
    """What of a belief is looked at: weighted particles in columns."""

    @property
    def count(self) -> int:
        """How many particles there are."""
        ...

    @property
    def weights(self) -> Float32Array:
        """Their weights, (count,), up to a common factor."""
        ...

    @property
    def columns(self) -> Float32Array:
        """Their states, (dimension, >= count): north, east, heading first."""
        ...


class Demand:
    """Counts the bins that a particle set occupies, and asks for as many particles as the bound says.

    Of a set larger than 8,192 a fair sample of that many is looked at, so bins are undercounted where a
    belief fills more than a few thousand of them.

    Parameters
    ----------
    position_bin, heading_bin : float
        Sides of a bin, metres and radians.
    error, probability : float
        Of the bound.
    minimum, maximum : int
        Limits of what is asked for.

    Raises
    ------
    ValueError
        A bin's side, the error, the probability or the limits out of range.
    """

    def __init__(
        self,
        position_bin: float,
        heading_bin: float,
        *,
        error: float = 0.05,
        probability: float = 0.99,
        minimum: int = 100,
        maximum: int = 1_000_000,
    ) -> None:
        if not (0.0 < position_bin < math.inf and 0.0 < heading_bin < math.inf):
            raise ValueError(
                f"demand: bins must have positive sides, got {position_bin} m and {heading_bin} rad"
            )
        if not 1 <= minimum <= maximum:
            raise ValueError(f"demand: 1 <= minimum <= maximum, got {minimum} and {maximum}")
        bound(2, error, probability)
        self._per_metre = 1.0 / position_bin
        self._per_radian = 1.0 / heading_bin
        self._error = error
        self._probability = probability
        self._minimum = minimum
        self._maximum = maximum
        self._keys = np.zeros(4 * SAMPLE, np.int64)
        self._stamps = np.zeros(4 * SAMPLE, np.int32)
        self._stamp = 0
        self._draw_keys = np.zeros(0, np.int64)
        self._draw_stamps = np.zeros(0, np.int32)
        self._draw_stamp = 0

    def bins(self, belief: Weighted) -> int:
        """Count occupied bins of (north, east, heading)."""
        count = belief.count
        samples = min(count, SAMPLE)
        if samples == 0:
            return 0
        self._stamp = self._stamp % 0x7FFFFFFE + 1
        if self._stamp == 1:
            self._stamps[:] = 0
        weights = belief.weights
        least = LIGHT * float(weights.mean())
        return occupied(
            belief.columns,
            weights,
            count,
            samples,
            least,
            self._per_metre,
            self._per_metre,
            self._per_radian,
            self._keys,
            self._stamps,
            self._stamp,
        )

    def particles(self, belief: Weighted) -> int:
        """Say how many particles the belief needs, within the limits."""
        return min(self._maximum, bound(self.bins(belief), self._error, self._probability, self._minimum))

    def draws(self, belief: Weighted, uniform: float) -> int:
        """Say how many draws from the weighted set Fox's loop takes: count bins first, then resample to this.

        Draw by draw, the bins touched are counted, until there are as many draws as the bound asks for. The draws are
        spread over the weights as evenly as those of Table 4.4, from every first draw on. ``Demand.particles`` counts
        the bins of the particles there are; this counts the bins of those that will be left.

        Parameters
        ----------
        belief : Weighted
            Weights need not be normalised.
        uniform : float
            The random number that starts the draws, in (0, 1].

        Returns
        -------
        int
            Within the limits; the minimum if all draws fall into one bin.

        Raises
        ------
        ValueError
            A uniform outside (0, 1], or weights whose sum is not positive and finite.
        """
        if not 0.0 < uniform <= 1.0:
            raise ValueError(f"demand: uniform must lie in (0, 1], got {uniform}")
        cumulative = np.cumsum(belief.weights, dtype=np.float64)
        if cumulative.size == 0 or not 0.0 < cumulative[-1] < math.inf:
            raise ValueError(f"demand: {cumulative.size} weights must have a positive finite sum")
        self._make_room(min(self._maximum, belief.count))
        drawn, _ = draws_until_enough(
            belief.columns,
            cumulative,
            uniform,
            self._per_metre,
            self._per_metre,
            self._per_radian,
            self._minimum,
            self._maximum,
            self._error,
            _quantile(self._probability),
            self._draw_keys,
            self._draw_stamps,
            self._draw_stamp,
        )
        return drawn

    def _make_room(self, bins: int) -> None:
        """See that the table of the draws has at least twice as many places as there can be bins, and a new stamp."""
        size = 1 << (2 * bins).bit_length()
        if self._draw_keys.size < size or self._draw_stamp == 0x7FFFFFFF:
            self._draw_keys = np.zeros(size, np.int64)
            self._draw_stamps = np.zeros(size, np.int32)
            self._draw_stamp = 0
        self._draw_stamp += 1
