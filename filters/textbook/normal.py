"""The normal distribution over arrays: density and cumulative probability."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Vector = NDArray[np.float64]

_erfc = np.frompyfunc(math.erfc, 1, 1)


def density(x: ArrayLike, mean: ArrayLike = 0.0, sigma: ArrayLike = 1.0) -> Vector:
    """Density N(x; mean, sigma²), in one over the unit of x."""
    deviation = np.asarray(sigma, np.float64)
    return np.exp(-0.5 * _standard(x, mean, deviation) ** 2) / (deviation * math.sqrt(2.0 * math.pi))


def cumulative(x: ArrayLike, mean: ArrayLike = 0.0, sigma: ArrayLike = 1.0) -> Vector:
    """Probability of a value up to x, with full relative precision in the lower tail."""
    standard = _standard(x, mean, np.asarray(sigma, np.float64))
    return 0.5 * np.asarray(_erfc(-standard / math.sqrt(2.0)), np.float64)


def _standard(x: ArrayLike, mean: ArrayLike, sigma: Vector) -> Vector:
    return (np.asarray(x, np.float64) - np.asarray(mean, np.float64)) / sigma
