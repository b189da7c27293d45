"""Arithmetic where some dimensions are angles: differences, means, and the normal that is wound on a circle.

A wrapped normal is the sum of a normal over all turns. Its parameter sigma is that of the normal before it was
wound; its own standard deviation, of wrapped differences, is less and ends at pi / √3, the uniform's.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from filters.density.protocol import Array

Flags = NDArray[np.bool_]

TURN = 2.0 * math.pi
REACH = 8.5
"""Standard deviations beyond which a normal is nothing in double precision: exp(-36)."""
UNIFORM = 8.0
"""A normal of this many radians, wound on a circle, is uniform to 1e-14."""


def wrap(angle: Array) -> Array:
    """Return the same angle in [-pi, pi)."""
    folded = angle - TURN * np.floor((angle + math.pi) / TURN)
    return np.where(np.abs(folded) >= math.pi, -math.pi, folded)


def wrap_columns(points: Array, circular: Flags) -> Array:
    """Return points (…, d) with the dimensions that wrap in [-pi, pi); a copy only if there are any."""
    if not circular.any():
        return points
    wrapped = points.copy()
    wrapped[..., circular] = wrap(points[..., circular])
    return wrapped


def difference(points: Array, centre: Array, circular: Flags) -> Array:
    """Return points less centre, the shortest way round in the dimensions that wrap."""
    return wrap_columns(points - centre, circular)


def mean(points: Array, weights: Array, circular: Flags) -> Array:
    """Return the mean of (count, d) points, with weights that sum to one; of angles the mean direction."""
    out = weights @ points
    angles = points[:, circular]
    out[circular] = wrap(np.arctan2(weights @ np.sin(angles), weights @ np.cos(angles)))
    return out


class Wound(NamedTuple):
    """What winding does to y ~ N(offset, sigma²), with w = wrap(y).

    Attributes
    ----------
    mean : float
        E[w].
    square : float
        E[w²].
    slope : float
        E[dw/dy], the jumps included: Cov[x, w] = slope · Cov[x, y] for any x that is jointly normal with y.
    """

    mean: float
    square: float
    slope: float


def wound(offset: float, sigma: float) -> Wound:
    """Return the moments of wrap(y), y ~ N(offset, sigma²), the offset in [-pi, pi]; exact to rounding."""
    if sigma == 0.0 or abs(offset) + REACH * sigma < math.pi:
        return Wound(offset, offset * offset + sigma * sigma, 1.0)
    if sigma > UNIFORM:
        return Wound(0.0, math.pi**2 / 3.0, 0.0)
    last = math.ceil((abs(offset) + REACH * sigma) / TURN + 0.5)
    turns = np.arange(-last, last + 1)
    z = ((2 * np.arange(-last, last + 2) - 1) * math.pi - offset) / sigma
    below = 0.5 * np.array([math.erfc(-value / math.sqrt(2.0)) for value in z])
    height = np.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
    share, fall, away = np.diff(below), -np.diff(height), offset - TURN * turns
    square = away**2 * share + 2.0 * sigma * away * fall + sigma**2 * (share - np.diff(z * height))
    slope = 1.0 - TURN * float(height.sum()) / sigma
    return Wound(float(away @ share + sigma * fall.sum()), float(square.sum()), slope)


def unwound(deviation: float) -> float:
    """Return the sigma of the normal which, wound on a circle, has this standard deviation; at most UNIFORM.

    A table of the Fourier series of the wound variance, pi²/3 + 4 Σ (-1)ⁿ exp(-n² sigma²/2) / n², then one
    step of Newton's.
    """
    if REACH * deviation < math.pi:
        return deviation
    sigmas, variances = _variances()
    if deviation * deviation >= variances[-1]:
        return UNIFORM
    sigma = float(np.interp(deviation * deviation, variances, sigmas))
    slope = -4.0 * sigma * float(_SIGNS @ np.exp(-0.5 * (_TERMS * sigma) ** 2))
    if slope < 1e-5:
        return sigma
    return sigma + (deviation * deviation - wound(0.0, sigma).square) / slope


_TERMS = np.arange(1.0, 26.0)
_SIGNS = np.where(_TERMS % 2 == 1, -1.0, 1.0)


@lru_cache(maxsize=1)
def _variances() -> tuple[Array, Array]:
    """Sigmas from where winding begins to matter, and the variances of the wound normals."""
    sigmas = np.geomspace(0.36, UNIFORM, 4096)
    series = np.exp(-0.5 * np.square(np.outer(sigmas, _TERMS))) @ (_SIGNS / _TERMS**2)
    return sigmas, np.maximum.accumulate(math.pi**2 / 3.0 + 4.0 * series)
