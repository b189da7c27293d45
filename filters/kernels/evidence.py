"""What several measurements say, one after the other: the sums of the weights after each of them, in one call.

The evidence of a measurement is the mean likelihood under the weights before it (:class:`filters.belief.Evidence`), so
the weights are summed after every measurement; over particles evenly spaced among all, which a *sample* is of.
"""

from __future__ import annotations

import numpy as np
from numpy import uint64
from numpy.typing import NDArray

from filters.kernels.compile import Float32Array, kernel
from filters.kernels.weights import log_sum

CHUNK = 4096
"""Particles that are weighed by all measurements before the next have their turn: they stay in the nearest cache."""


@kernel("void(float32[::1], int64, int64, int64, float32[::1])", exact=True)
def thin(log_weights: Float32Array, first: int, last: int, stride: int, sample: Float32Array) -> None:
    """Copy every ``stride``-th log weight, counted from particle 0, that lies among ``first`` to ``last``."""
    start = (first + stride - 1) // stride
    end = min((last + stride - 1) // stride, sample.size)
    if stride == 1:
        logs = log_weights[first:last]
        kept = sample[first:last]
        for i in range(logs.size):
            kept[i] = logs[i]
    else:
        for k in range(start, end):
            sample[uint64(k)] = log_weights[uint64(k * stride)]


@kernel("float64(float32[:, ::1], int64, int64, float64, float64[:, ::1])")
def account_for(
    samples: Float32Array, rows: int, count: int, before: float, said: NDArray[np.float64]
) -> float:
    """Make log evidence of what ``said`` has in its first column, a log likelihood at its best.

    ``samples`` has a row of ``count`` log weights as they were after each measurement, and ``before`` is the logarithm
    of the sum of the weights before the first. Returns that after the last.
    """
    for row in range(rows):
        after = log_sum(samples[row], count, 1, samples[row])
        said[row, 0] = said[row, 0] + after - before if after > -np.inf else after
        before = after
    return before
