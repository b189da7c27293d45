"""What a measurement says of the noise of motion and sensor; see :mod:`filters.linearised.noise_shares`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from filters.kernels.bank import LOG_TWO_PI
from filters.kernels.compile import function, kernel
from filters.kernels.error_level import log_sum

Float64Array = NDArray[np.float64]


@function
def log_added(first: float, second: float) -> float:
    """Logarithm of the sum of two exponentials."""
    top, other = max(first, second), min(first, second)
    return top if other == -math.inf else top + math.log1p(math.exp(other - top))


@function
def spread_between(covariance: Float64Array, jacobian: Float64Array, other: Float64Array) -> float:
    """One entry of H C Hᵀ, of two rows of H."""
    total = 0.0
    for k in range(jacobian.size):
        if jacobian[k] != 0.0:
            inner = 0.0
            for q in range(jacobian.size):
                inner += covariance[k, q] * other[q]
            total += jacobian[k] * inner
    return total


@function
def normalise(logs: Float64Array) -> None:
    """Make logarithms those of probabilities that sum to one."""
    total = log_sum(logs)
    for i in range(logs.size):
        logs[i] -= total


@function
def weigh(log_belief: Float64Array, logs: Float64Array, weight: float) -> bool:
    """Add evidence, which counts ``weight`` times, to a belief; none that is not finite."""
    for i in range(logs.size):
        if not math.isfinite(logs[i]):
            return False
    for i in range(logs.size):
        log_belief[i] += weight * logs[i]
    normalise(log_belief)
    return True


@kernel(
    "void(float64[:, :, ::1], float64[:, ::1], float64[:, :, ::1], float64[:, ::1], float64[::1], float64,"
    "float64[:, ::1])",
    exact=True,
)
def log_densities(
    covariance: Float64Array,
    residual: Float64Array,
    jacobian: Float64Array,
    noise: Float64Array,
    shares: Float64Array,
    log_outlier: float,
    table: Float64Array,
) -> None:
    """Write the log density of a residual, an outlier's added, by member and share of the sensor's variance."""
    for m in range(residual.shape[0]):
        c, h, r = covariance[m], jacobian[m], residual[m]
        first = spread_between(c, h[0], h[0])
        if r.size == 1:
            for s in range(shares.size):
                total = first + shares[s] * noise[m, 0]
                log = -0.5 * (r[0] * r[0] / total + math.log(total) + LOG_TWO_PI)
                table[m, s] = log_added(log, log_outlier)
            continue
        across, second = spread_between(c, h[0], h[1]), spread_between(c, h[1], h[1])
        for s in range(shares.size):
            one, two = first + shares[s] * noise[m, 0], second + shares[s] * noise[m, 1]
            determinant = one * two - across * across
            square = (two * r[0] * r[0] - 2.0 * across * r[0] * r[1] + one * r[1] * r[1]) / determinant
            log = -0.5 * (square + math.log(determinant)) - LOG_TWO_PI
            table[m, s] = log_added(log, log_outlier)


@kernel(
    "boolean(float64[:, ::1], float64, float64[::1], float64[::1], float64, float64[::1], float64)",
    exact=True,
)
def learn(
    table: Float64Array,
    weight: float,
    log_belief: Float64Array,
    own: Float64Array,
    own_weight: float,
    own_prior: Float64Array,
    forgotten: float,
) -> bool:
    """Learn of motion and sensor together, of each by what is known of the other; say whether of the sensor, too.

    ``table`` has a row for each share of the motion's noise and a column for each of the sensor's. Of what was known of
    the sensor the share ``forgotten`` goes back to its prior belief.
    """
    members, shares = table.shape
    logs, said = np.empty(members), np.empty(shares)
    for m in range(members):
        logs[m] = -math.inf
        for s in range(shares):
            logs[m] = log_added(logs[m], table[m, s] + own[s])
    if not weigh(log_belief, logs, weight) or not own_weight > 0.0:
        return False
    for s in range(shares):
        said[s] = -math.inf
        for m in range(members):
            said[s] = log_added(said[s], table[m, s] + log_belief[m])
    if not weigh(own, said, own_weight):
        return False
    for s in range(shares):
        own[s] = math.log((1.0 - forgotten) * math.exp(own[s]) + forgotten * own_prior[s])
    return True


@kernel("void(float64[::1], float64, float64, int64, float64[::1])", exact=True)
def learn_wandering(
    logs: Float64Array, log_outlier: float, weight: float, distances: int, log_belief: Float64Array
) -> None:
    """Learn of the motion from evidence by which no share above one is more likely than one itself.

    An error that wanders looks like a vehicle that does. The members are rows of turns by columns of ``distances``, and
    the second of either is the share of one.
    """
    said = np.empty(logs.size)
    for m in range(logs.size):
        said[m] = log_added(logs[m], log_outlier)
    for m in range(distances):
        said[m] = min(said[m], said[m + distances])
    for m in range(0, logs.size, distances):
        said[m] = min(said[m], said[m + 1])
    weigh(log_belief, said, weight)
