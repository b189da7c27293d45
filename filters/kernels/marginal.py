"""Kalman filters by the column: means of linear states, one per particle, under gains that are the same for all.

Every inner loop runs over particles and is a sum of one product, so it vectorises whatever the number of states.
"""

from __future__ import annotations

import numpy as np
from numpy import float32
from numpy.typing import NDArray

from filters.kernels.compile import Float32Array, kernel
from filters.kernels.elementary import wrapped


@kernel("void(float32[:, ::1], float32[:, ::1], int64, float32[:, ::1], int64, int64)")
def add_product(
    matrix: Float32Array,
    source: Float32Array,
    source_first: int,
    target: Float32Array,
    target_first: int,
    count: int,
) -> None:
    """Add ``matrix @ source`` to ``target``: ``count`` columns of each from their first ones on."""
    for row in range(matrix.shape[0]):
        out = target[row, target_first : target_first + count]
        for k in range(matrix.shape[1]):
            factor = matrix[row, k]
            if factor == float32(0.0):
                continue
            values = source[k, source_first : source_first + count]
            for i in range(count):
                out[i] += factor * values[i]


@kernel("void(float32[:, ::1], float32[::1], boolean[::1], int64)")
def subtract_from(
    values: Float32Array, measured: Float32Array, circular: NDArray[np.bool_], count: int
) -> None:
    """Turn what is expected into the innovation: measured minus expected, wrapped where it is an angle."""
    for row in range(values.shape[0]):
        z = measured[row]
        value = values[row]
        if circular[row]:
            for i in range(count):
                value[i] = wrapped(float32(z - value[i]))
        else:
            for i in range(count):
                value[i] = float32(z - value[i])


@kernel("void(float32[:, ::1], float32[::1], int64, int64)")
def weigh(white: Float32Array, log_weights: Float32Array, first: int, last: int) -> None:
    """Take half the squares of the whitened innovations, (m, >= last - first), off the log weights."""
    log_weight = log_weights[first:last]
    for row in range(white.shape[0]):
        value = white[row]
        for i in range(last - first):
            log_weight[i] -= float32(0.5) * value[i] * value[i]
