"""Regularised resampling: after copying, each value is drawn from a kernel about itself.

Resampling leaves many copies of few values. Where nothing moves them apart again, as with slow states, the set ends
as copies of one value, and claims to be certain. So the copies are drawn from a Gaussian kernel of the set's own
covariance V, scaled by a bandwidth h (Musso, Oudjane and Le Gland, "Improving regularised particle filters", 2001)::

    h = (4 / ((d + 2) n))^(1 / (d + 4))          Silverman's rule: d dimensions, n particles' worth of values

A kernel adds variance: h² V at every resampling. Liu and West ("Combined parameter and state estimation in
simulation-based filtering", 2001) first draw the values together about their mean m, which preserves mean and
covariance exactly in expectation::

    x = m + sqrt(1 - h²) (x - m) + h L n,        V = L Lᵀ, n standard normal
"""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray


class Kernel(NamedTuple):
    """What is done to the values: shrunk about the mean by ``factor``, then spread by ``bandwidth``."""

    factor: float
    bandwidth: float


class Rule(Protocol):
    """The named requirement of a rule: which kernel fits a set."""

    def kernel(self, effective_sample_size: float, dimension: int) -> Kernel:
        """Return the kernel for so many particles' worth of values in so many dimensions."""
        ...


def silverman(effective_sample_size: float, dimension: int) -> float:
    """Return the bandwidth that is best for a Gaussian density, in standard deviations of the set.

    Raises
    ------
    ValueError
        Fewer than one particle's worth of values, or no dimension.
    """
    if not (effective_sample_size >= 1.0 and dimension >= 1):
        raise ValueError(
            f"bandwidth: at least one particle and one dimension, got {effective_sample_size} and {dimension}"
        )
    return (4.0 / ((dimension + 2) * effective_sample_size)) ** (1.0 / (dimension + 4))


class Spreading:
    """The plain kernel: the variance grows by h² at every resampling. For states that wander more than modelled."""

    def kernel(self, effective_sample_size: float, dimension: int) -> Kernel:
        """Return Silverman's bandwidth and no shrinkage."""
        return Kernel(1.0, silverman(effective_sample_size, dimension))


class Preserving:
    """The kernel of Liu and West: mean and covariance stay. For states that do not move, such as parameters."""

    def kernel(self, effective_sample_size: float, dimension: int) -> Kernel:
        """Return Silverman's bandwidth, at most 1, and the shrinkage that makes up for it."""
        bandwidth = min(1.0, silverman(effective_sample_size, dimension))
        return Kernel(math.sqrt(1.0 - bandwidth * bandwidth), bandwidth)


def weighted_covariance(
    rows: NDArray[np.float32], weights: NDArray[np.float32]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return mean (d,) and covariance (d, d) of weighted columns (d, n)."""
    share = weights / weights.sum(dtype=np.float64)
    mean = rows @ share
    away = rows - mean[:, None]
    return mean, (away * share) @ away.T


def root(covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return L with L Lᵀ = V, also where V is singular: a set may have one value."""
    values, vectors = np.linalg.eigh(covariance)
    return vectors * np.sqrt(np.maximum(values, 0.0))
