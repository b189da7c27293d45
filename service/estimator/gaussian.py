"""A belief as one Gaussian: whether it is near enough to one, and which.

The banks of Kalman filters that go along with the particles (:mod:`service.estimator.witnesses`,
:mod:`service.estimator.mode`, :mod:`service.estimator.caution`, :mod:`service.estimator.receivers`,
:mod:`service.estimator.latency`) begin as it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from filters.belief import Moments
from filters.kalman import Matrix
from filters.particle import ParticleFilter
from service.estimator.start import RECEIVER_BIAS

ONE_HEADING = 0.35
"""Radians: a heading with more spread than this bends the belief."""

SAMPLE = 2048
"""The covariance is taken over so many particles at most."""

_HEADING = 2


def is_one_place(moments: Moments, metres: float) -> bool:
    """Say whether a belief is one place: its spread is at most ``metres`` in each axis, and it knows its heading."""
    variance = moments.variance
    return float(variance[0] + variance[1]) <= 2.0 * metres**2 and float(variance[2]) <= ONE_HEADING**2


def gaussian_of(
    belief: ParticleFilter[Any], given_path: dict[str, float], errors: Sequence[str] = ()
) -> tuple[Matrix, Matrix]:
    """Return mean and covariance of a belief, over an even sample of its particles.

    The errors of receivers, which come last, are left out, but for those that are asked for.

    Parameters
    ----------
    given_path : dict[str, float]
        Variances of the marginalised dimensions beside the spread of the particles' own values.
    errors : sequence of str
        Receivers' errors that are to follow the other dimensions.
    """
    step = -(-belief.count // SAMPLE)
    weights = belief.weights[::step].astype(np.float64)
    weights /= weights.sum()
    names = [*(name for name in belief.names if not name.startswith(RECEIVER_BIAS)), *errors]
    rows = [belief.names.index(name) for name in names]
    columns: NDArray[np.float64] = belief.columns[rows, : belief.count : step].astype(np.float64)
    heading = columns[_HEADING]
    centre = math.atan2(weights @ np.sin(heading), weights @ np.cos(heading))
    columns[_HEADING] = centre + np.remainder(heading - centre + math.pi, 2.0 * math.pi) - math.pi
    mean = columns @ weights
    away = columns - mean[:, None]
    covariance = (away * weights) @ away.T
    for name, variance in given_path.items():
        row = names.index(name)
        covariance[row, row] += variance
    return mean, 0.5 * (covariance + covariance.T)
