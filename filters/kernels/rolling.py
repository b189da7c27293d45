"""The unicycle linearised, written out; the equations are those of :mod:`filters.linearised.unicycle`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from filters.kernels.compile import kernel

Float64Array = NDArray[np.float64]


@kernel(
    "void(float64[::1], float64, float64, float64, float64, float64, float64[::1], float64[::1], float64[:, ::1],"
    "float64[:, ::1])",
    exact=True,
)
def linearise(
    mean: Float64Array,
    rolled: float,
    turned: float,
    duration: float,
    distance_variance: float,
    turn_variance: float,
    walk_variances: Float64Array,
    moved: Float64Array,
    jacobian: Float64Array,
    noise: Float64Array,
) -> None:
    """Write where the motion takes the mean, its Jacobian, and its noise; the two matrices hold zeros before.

    Bias and scale walk before they act, so their walks come into the pose by the same derivatives.
    """
    distance, turn = mean[4] * rolled, turned - mean[3] * duration
    middle = mean[2] + 0.5 * turn
    sine, cosine = math.sin(middle), math.cos(middle)
    for k in range(mean.size):
        moved[k] = mean[k]
        jacobian[k, k] = 1.0
        noise[k, k] = walk_variances[k] * duration
    moved[0] += distance * cosine
    moved[1] += distance * sine
    moved[2] += turn
    jacobian[0, 2], jacobian[1, 2] = -distance * sine, distance * cosine
    bias_variance, scale_variance = noise[3, 3], noise[4, 4]
    by_turn = (-0.5 * distance * sine, 0.5 * distance * cosine, 1.0)
    by_distance = (cosine, sine, 0.0)
    about = turn_variance + duration * duration * bias_variance
    along = distance_variance + rolled * rolled * scale_variance
    for i in range(3):
        jacobian[i, 3], jacobian[i, 4] = -duration * by_turn[i], rolled * by_distance[i]
        noise[i, 3] = noise[3, i] = jacobian[i, 3] * bias_variance
        noise[i, 4] = noise[4, i] = jacobian[i, 4] * scale_variance
        for j in range(3):
            noise[i, j] += along * by_distance[i] * by_distance[j] + about * by_turn[i] * by_turn[j]
