"""Weighted covariance of any columns, for what a pose's moments leave out: how position and velocity hang together.

Offsets are taken from a reference near the mean and summed in single precision over runs of 1,024 particles; the runs
are added in double precision, always in the same order.
"""

from __future__ import annotations

import numpy as np
from numpy import float32, float64
from numpy.typing import NDArray

from filters.kernels.compile import Float32Array, function, kernel

RUN = 1024


@function
def weight_of(weight: Float32Array) -> np.float32:
    """Sum of the weights of a run."""
    total = float32(0.0)
    for i in range(weight.size):
        total += weight[i]
    return total


@function
def offset_of(weight: Float32Array, column: Float32Array, reference: np.float32) -> np.float32:
    """Weighted sum of a column's offsets from its reference."""
    total = float32(0.0)
    for i in range(weight.size):
        total += float32(weight[i] * float32(column[i] - reference))
    return total


@function
def product_of(
    weight: Float32Array,
    one: Float32Array,
    one_reference: np.float32,
    other: Float32Array,
    other_reference: np.float32,
) -> np.float32:
    """Weighted sum of the products of two columns' offsets."""
    total = float32(0.0)
    for i in range(weight.size):
        total += float32(weight[i] * float32(one[i] - one_reference)) * float32(other[i] - other_reference)
    return total


@kernel("void(float32[:, ::1], float32[::1], int64, int64[::1], float64[::1], float64[::1], float64[:, ::1])")
def covariance(
    columns: Float32Array,
    weights: Float32Array,
    count: int,
    rows: NDArray[np.int64],
    reference: NDArray[np.float64],
    mean: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """Write the mean, (k,), and the covariance, (k, k), of the rows of the first ``count`` particles."""
    mean[:] = 0.0
    out[:, :] = 0.0
    total = float64(0.0)
    for first in range(0, count, RUN):
        last = min(count, first + RUN)
        weight = weights[first:last]
        total += weight_of(weight)
        for a in range(rows.size):
            one, at = columns[rows[a], first:last], float32(reference[a])
            mean[a] += offset_of(weight, one, at)
            for b in range(a + 1):
                out[a, b] += product_of(weight, one, at, columns[rows[b], first:last], float32(reference[b]))
    mean /= total
    for a in range(rows.size):
        for b in range(a + 1):
            out[a, b] = out[a, b] / total - mean[a] * mean[b]
            out[b, a] = out[a, b]
        out[a, a] = max(out[a, a], 0.0)
    for a in range(rows.size):
        mean[a] += float64(float32(reference[a]))
