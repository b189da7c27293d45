"""What two Gaussians make of a reading of which neither has heard; see :mod:`service.estimator.witnesses`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from filters.kernels.compile import kernel
from filters.kernels.error_level import normalised, surprise
from filters.kernels.expectations import spread_of

Float64Array = NDArray[np.float64]


@kernel(
    "void(float64[:, :, ::1], float64[:, ::1], float64[:, :, ::1], float64[:, ::1], float64[::1], float64[::1],"
    "float64, float64, int64, float64[:, ::1], float64[::1], float64[::1])",
    exact=True,
)
def hear_out(
    covariance: Float64Array,
    residual: Float64Array,
    jacobian: Float64Array,
    noise: Float64Array,
    log_belief: Float64Array,
    cautions: Float64Array,
    usual: float,
    repeats: float,
    member: int,
    spread: Float64Array,
    claimed: Float64Array,
    said: Float64Array,
) -> None:
    """Write the spread of what a member expects; and the NIS of a reading, its surprise, and what its noise excuses.

    ``claimed`` becomes the variance of each component, of a reading that shares its error with no other;
    ``usual`` is the variance that honest readings may have beside it.
    """
    spread_of(covariance, jacobian, member, spread)
    mean = excused = 0.0
    for z in range(claimed.size):
        claimed[z] = noise[member, z] / repeats
        mean += claimed[z]
        excused += 0.5 * math.log1p(claimed[z] / usual)
    said[0] = normalised(residual[member], spread, claimed)
    said[1] = surprise(log_belief, cautions, mean / claimed.size + usual, residual[member], spread)
    said[2] = excused
