"""A belief as a Gaussian: how large a circle or ellipse about the mean holds how much of it."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

_RATIOS = 129
_ANGLES = 256


def probability_within(radius: ArrayLike, major: ArrayLike, minor: ArrayLike) -> NDArray[np.float64]:
    """Probability of the circle of a radius about the mean of a Gaussian with these standard deviations.

    In whitened polar coordinates the radius is Rayleigh and the angle uniform, so the probability is one
    minus the mean over the angle of exp(-r² / 2(major² cos² + minor² sin²)): smooth and periodic, for the
    mid-point rule.
    """
    angle = (np.arange(_ANGLES) + 0.5) * (0.5 * math.pi / _ANGLES)
    variance = (
        np.square(np.asarray(major, np.float64))[..., None] * np.cos(angle) ** 2
        + np.square(np.asarray(minor, np.float64))[..., None] * np.sin(angle) ** 2
    )
    square = np.square(np.asarray(radius, np.float64))[..., None]
    return 1.0 - np.exp(-0.5 * square / variance).mean(axis=-1)


@lru_cache(maxsize=16)
def _table(probability: float) -> list[float]:
    """Radius over the larger standard deviation, by the ratio of the smaller to the larger, 0 to 1."""
    ratios = np.linspace(0.0, 1.0, _RATIOS)
    low = np.zeros(_RATIOS)
    high = np.full(_RATIOS, 1.01 * math.sqrt(-2.0 * math.log1p(-probability)))
    for _ in range(32):
        middle = 0.5 * (low + high)
        below = probability_within(middle, np.ones(_RATIOS), ratios) < probability
        low = np.where(below, middle, low)
        high = np.where(below, high, middle)
    return (0.5 * (low + high)).tolist()


def radius(covariance: ArrayLike, probability: float) -> float:
    """Radius of the circle about the mean that holds a given probability of a two-dimensional Gaussian.

    Between 1.960 (one direction only) and 2.448 (round) times the larger standard deviation for 95 %. The
    first call for a probability builds a table; later ones interpolate in it, to better than 1e-4.

    Parameters
    ----------
    covariance : (2, 2) array
        Symmetric, not negative; only the upper triangle is read.
    probability : float
        In (0, 1).

    Raises
    ------
    ValueError
        A probability outside (0, 1), or a covariance that is not finite.
    """
    if not 0.0 < probability < 1.0:
        raise ValueError(f"radius: probability must lie in (0, 1), got {probability}")
    matrix = np.asarray(covariance, np.float64)
    nn, ne, ee = matrix.item(0, 0), matrix.item(0, 1), matrix.item(1, 1)
    middle = 0.5 * (nn + ee)
    half = math.hypot(0.5 * (nn - ee), ne)
    if not math.isfinite(middle + half):
        raise ValueError(f"radius: the covariance must be finite, got {matrix[:2, :2].tolist()}")
    major = math.sqrt(max(middle + half, 0.0))
    if major == 0.0:
        return 0.0
    place = math.sqrt(max(middle - half, 0.0)) / major * (_RATIOS - 1)
    index = min(int(place), _RATIOS - 2)
    table = _table(probability)
    lower = table[index]
    return major * (lower + (place - index) * (table[index + 1] - lower))


def mahalanobis_square(difference: ArrayLike, covariance: ArrayLike) -> float:
    """Squared Mahalanobis distance: dᵀ C⁻¹ d, the normalised estimation error squared (NEES) of an error d.

    Raises
    ------
    numpy.linalg.LinAlgError
        The covariance has no inverse.
    """
    vector = np.asarray(difference, np.float64)
    return float(vector @ np.linalg.solve(np.asarray(covariance, np.float64), vector))


def inside(difference: ArrayLike, covariance: ArrayLike, probability: float) -> bool:
    """Whether a difference of two dimensions lies in the ellipse that holds ``probability`` of the Gaussian.

    In two dimensions the squared distance is exponential: the ellipse ends at -2 log(1 - probability).
    """
    return mahalanobis_square(difference, covariance) <= -2.0 * math.log1p(-probability)
