"""The Kalman filter's arithmetic on small dense matrices: what LAPACK takes longer to be called for than to do."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from filters.kernels.compile import function, kernel

Float64Array = NDArray[np.float64]

LOG_TWO_PI = math.log(2.0 * math.pi)

NOT_FINITE, NOT_POSITIVE, REFUSED, ACCEPTED = 0, 1, 2, 3
"""What became of a correction."""


@function
def product(left: Float64Array, right: Float64Array, out: Float64Array) -> None:
    """A B."""
    for i in range(left.shape[0]):
        for j in range(right.shape[1]):
            total = 0.0
            for k in range(left.shape[1]):
                total += left[i, k] * right[k, j]
            out[i, j] = total


@function
def congruence(left: Float64Array, middle: Float64Array, added: Float64Array, out: Float64Array) -> bool:
    """The symmetric part of A C Aᵀ + R; whether all of it is finite."""
    half = np.empty((left.shape[0], left.shape[1]))
    product(left, middle, half)
    finite = True
    for i in range(left.shape[0]):
        for j in range(left.shape[0]):
            total = added[i, j]
            for k in range(left.shape[1]):
                total += half[i, k] * left[j, k]
            out[i, j] = total
            finite = finite and math.isfinite(total)
    for i in range(left.shape[0]):
        for j in range(i):
            out[i, j] = out[j, i] = 0.5 * (out[i, j] + out[j, i])
    return finite


@function
def all_finite(matrix: Float64Array) -> bool:
    """Whether every number is finite."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            if not math.isfinite(matrix[i, j]):
                return False
    return True


@function
def cholesky(matrix: Float64Array, root: Float64Array) -> bool:
    """Write the lower triangular root L of L Lᵀ; whether the matrix is positive."""
    for i in range(matrix.shape[0]):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= root[i, k] * root[j, k]
            if i != j:
                root[i, j] = total / root[j, j]
            elif total > 0.0:
                root[i, i] = math.sqrt(total)
            else:
                return False
    return True


@function
def forward(root: Float64Array, vector: Float64Array) -> None:
    """Solve L x = b in place."""
    for i in range(vector.size):
        for k in range(i):
            vector[i] -= root[i, k] * vector[k]
        vector[i] /= root[i, i]


@function
def backward(root: Float64Array, vector: Float64Array) -> None:
    """Solve Lᵀ x = b in place."""
    for i in range(vector.size - 1, -1, -1):
        for k in range(i + 1, vector.size):
            vector[i] -= root[k, i] * vector[k]
        vector[i] /= root[i, i]


@function
def weigh(covariance: Float64Array, jacobian: Float64Array, root: Float64Array, gain: Float64Array) -> None:
    """Write the gain C Hᵀ S⁻¹, with the root of S."""
    for k in range(gain.shape[0]):
        for z in range(gain.shape[1]):
            total = 0.0
            for q in range(gain.shape[0]):
                total += covariance[k, q] * jacobian[z, q]
            gain[k, z] = total
        forward(root, gain[k])
        backward(root, gain[k])


@kernel("boolean(float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[:, ::1])", exact=True)
def propagate(
    jacobian: Float64Array, covariance: Float64Array, noise: Float64Array, moved: Float64Array
) -> bool:
    """Write G C Gᵀ + R; whether it is finite."""
    return congruence(jacobian, covariance, noise, moved)


@kernel(
    "Tuple((int64, float64, float64))(float64[::1], float64[:, ::1], float64[::1], float64[:, ::1], float64[:, ::1],"
    "float64, float64[:, ::1], float64[::1], float64[:, ::1])",
    exact=True,
)
def correct(
    mean: Float64Array,
    covariance: Float64Array,
    innovation: Float64Array,
    jacobian: Float64Array,
    noise: Float64Array,
    gate: float,
    innovation_covariance: Float64Array,
    moved: Float64Array,
    remaining: Float64Array,
) -> tuple[int, float, float]:
    """Weigh an innovation in, by Joseph's form; return what became of it, its NIS and the log evidence.

    Mean and covariance afterwards are written where it was accepted: not above the gate.
    """
    size, components = mean.size, innovation.size
    if not (all_finite(jacobian) and all_finite(noise) and math.isfinite(innovation.sum())):
        return NOT_FINITE, math.nan, math.nan
    root, white = np.zeros((components, components)), innovation.copy()
    congruence(jacobian, covariance, noise, innovation_covariance)
    if not cholesky(innovation_covariance, root):
        return NOT_POSITIVE, math.nan, math.nan
    forward(root, white)
    nis, log_evidence = 0.0, -0.5 * components * LOG_TWO_PI
    for z in range(components):
        nis += white[z] * white[z]
        log_evidence -= math.log(root[z, z])
    log_evidence -= 0.5 * nis
    if not nis <= gate:
        return REFUSED, nis, log_evidence
    gain, less, added = np.zeros((size, components)), np.eye(size), np.empty((size, size))
    weigh(covariance, jacobian, root, gain)
    for k in range(size):
        moved[k] = mean[k]
        for z in range(components):
            moved[k] += gain[k, z] * innovation[z]
            for q in range(size):
                less[k, q] -= gain[k, z] * jacobian[z, q]
    congruence(gain, noise, np.zeros((size, size)), added)
    congruence(less, covariance, added, remaining)
    return ACCEPTED, nis, log_evidence
