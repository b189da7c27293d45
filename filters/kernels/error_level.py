"""What is normal for a source, over a grid of pairs: sums of :mod:`filters.error_level`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from filters.kernels.compile import function, kernel

Float64Array = NDArray[np.float64]

SWEEPS = 8
"""Of Jacobi's rotations: convergence is quadratic; two dimensions need one."""


@function
def rotate(a: Float64Array, turned: Float64Array, i: int, j: int) -> None:
    """Turn axes i and j of a symmetric matrix and of a vector so that the matrix's entry between them vanishes."""
    angle = 0.5 * math.atan2(2.0 * a[i, j], a[i, i] - a[j, j])
    c, s = math.cos(angle), math.sin(angle)
    for k in range(turned.size):
        first, second = a[i, k], a[j, k]
        a[i, k], a[j, k] = c * first + s * second, c * second - s * first
    for k in range(turned.size):
        first, second = a[k, i], a[k, j]
        a[k, i], a[k, j] = c * first + s * second, c * second - s * first
    first, second = turned[i], turned[j]
    turned[i], turned[j] = c * first + s * second, c * second - s * first


@function
def principal(
    residual: Float64Array, spread: Float64Array, turned: Float64Array, spreads: Float64Array
) -> None:
    """Write residual and spread along the axes of the spread, by Jacobi's rotations; no spread is below zero."""
    size = residual.size
    a = spread.copy()
    turned[:] = residual
    for _ in range(SWEEPS if size > 2 else 1):
        for i in range(size):
            for j in range(i):
                if a[i, j] != 0.0:
                    rotate(a, turned, i, j)
    for i in range(size):
        spreads[i] = max(a[i, i], 0.0)


@function
def log_sum(logs: Float64Array) -> float:
    """Logarithm of the sum of exponentials."""
    top = -math.inf
    for i in range(logs.size):
        top = max(top, logs[i])
    total = 0.0
    for i in range(logs.size):
        total += math.exp(logs[i] - top)
    return top + math.log(total)


@kernel("float64(float64[::1], float64[::1], float64, float64[::1], float64[:, ::1])", exact=True)
def surprise(
    log_belief: Float64Array,
    cautions: Float64Array,
    floor: float,
    residual: Float64Array,
    spread: Float64Array,
) -> float:
    """Nats by which a residual is less likely than none, with the variance k P + floor along each axis of P."""
    size = residual.size
    turned, spreads = np.empty(size), np.empty(size)
    principal(residual, spread, turned, spreads)
    at_zero, found = np.empty(cautions.size), np.empty(cautions.size)
    for p in range(cautions.size):
        logs = square = 0.0
        for i in range(size):
            variance = cautions[p] * spreads[i] + floor
            logs += math.log(variance)
            square += turned[i] * turned[i] / variance
        at_zero[p] = log_belief[p] - 0.5 * logs
        found[p] = at_zero[p] - 0.5 * square
    return log_sum(at_zero) - log_sum(found)


@kernel(
    "void(float64[::1], float64[::1], float64, float64[::1], float64[:, ::1], float64, float64[::1])",
    exact=True,
)
def log_likelihoods(
    cautions: Float64Array,
    variances: Float64Array,
    noise: float,
    residual: Float64Array,
    spread: Float64Array,
    weight: float,
    logs: Float64Array,
) -> None:
    """Write ``weight`` times the log density of a residual by each pair, with the variance k P + noise + m²."""
    size = residual.size
    turned, spreads = np.empty(size), np.empty(size)
    principal(residual, spread, turned, spreads)
    for p in range(cautions.size):
        total = 0.0
        for i in range(size):
            variance = cautions[p] * spreads[i] + noise + variances[p]
            total += math.log(variance) + turned[i] * turned[i] / variance
        logs[p] = -0.5 * weight * total


@kernel("float64(float64[::1], float64[:, ::1], float64[::1])", exact=True)
def normalised(residual: Float64Array, spread: Float64Array, noise: Float64Array) -> float:
    """NIS: the squared residual in units of spread and noise, which is independent among the components."""
    size = residual.size
    root, white = np.zeros((size, size)), np.empty(size)
    square = 0.0
    for i in range(size):
        white[i] = residual[i]
        for j in range(i + 1):
            total = spread[i, j] + (noise[i] if i == j else 0.0)
            for k in range(j):
                total -= root[i, k] * root[j, k]
            root[i, j] = math.sqrt(total) if i == j else total / root[j, j]
        for j in range(i):
            white[i] -= root[i, j] * white[j]
        white[i] /= root[i, i]
        square += white[i] * white[i]
    return square
