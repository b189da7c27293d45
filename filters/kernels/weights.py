"""Importance weights: from log weights to weights, and the sums over them.

Sums over a block run in float32 registers (32,768 terms at most). Each block has a row of sums of its own, and the
rows are added in float64 and in order, so the result does not depend on who summed which block. The largest log
weight is found as an integer, because a float maximum does not vectorise.
"""

from __future__ import annotations

import math

import numpy as np
from numpy import float32, int32
from numpy.typing import NDArray

from filters.kernels.compile import Float32Array, kernel
from filters.kernels.elementary import exp, from_order, order, sincos, wrapped

Float64Array = NDArray[np.float64]
Int64Array = NDArray[np.int64]

NOTHING = float32(-1e30)
"""A log weight from here down is that of a particle which cannot be."""


@kernel("float64(float32[::1], int64, int64)")
def peak(log_weights: Float32Array, first: int, last: int) -> float:
    """Largest log weight of a block.

    NaN orders by its sign bit: a positive one above infinity, a negative one (what processors make) below all, and
    `exponentiate` gives it no weight.
    """
    largest = int32(-2147483647)
    logs = log_weights[first:last]
    for i in range(last - first):
        largest = max(largest, order(logs[i]))
    return float(from_order(largest))


@kernel("void(float32[::1], float32[::1], int64[::1], int64, int64, float32, float64[:, ::1])")
def exponentiate(
    log_weights: Float32Array,
    weights: Float32Array,
    bounds: Int64Array,
    first_block: int,
    last_block: int,
    top: float,
    sums: Float64Array,
) -> None:
    """Take ``top`` off the log weights and write the weights of some blocks; ``sums`` has a row for each block.

    Block b lies from ``bounds[b]`` to ``bounds[b + 1]``; its row is the sum of the weights and of their squares.
    """
    for block in range(first_block, last_block):
        logs = log_weights[bounds[block] : bounds[block + 1]]
        out = weights[bounds[block] : bounds[block + 1]]
        total = float32(0.0)
        squares = float32(0.0)
        for i in range(logs.size):
            log_weight = float32(logs[i] - top)
            weight = exp(log_weight)
            logs[i] = log_weight
            out[i] = weight
            total += weight
            squares += weight * weight
        sums[block, 0] = total
        sums[block, 1] = squares


@kernel("UniTuple(float64, 2)(float64[:, ::1], int64)", exact=True)
def add(sums: Float64Array, blocks: int) -> tuple[float, float]:
    """Add the blocks' rows in order."""
    total = squares = 0.0
    for block in range(blocks):
        total += sums[block, 0]
        squares += sums[block, 1]
    return total, squares


@kernel("UniTuple(float64, 3)(float32[::1], float32[::1], int64[::1], float64[:, ::1])")
def normalize(
    log_weights: Float32Array, weights: Float32Array, bounds: Int64Array, sums: Float64Array
) -> tuple[float, float, float]:
    """Exponentiate all blocks less the largest log weight, for one thread; nothing is done if all are nothing.

    Returns the largest log weight, the sum of the weights and that of their squares.
    """
    blocks = bounds.size - 1
    top = peak(log_weights, 0, bounds[blocks])
    if not NOTHING < top < np.inf:
        return top, 0.0, 0.0
    exponentiate(log_weights, weights, bounds, 0, blocks, top, sums)
    total, squares = add(sums, blocks)
    return top, total, squares


@kernel("float64(float32[::1], int64, int64, float32[::1])")
def log_sum(log_weights: Float32Array, count: int, stride: int, sample: Float32Array) -> float:
    """Logarithm of the sum of ``count`` weights, every ``stride``-th; minus infinity if all are zero.

    ``sample`` takes them: a strided loop does not vectorise.
    """
    logs = log_weights[:count]
    if stride > 1:
        logs = sample[:count]
        for k in range(count):
            logs[k] = log_weights[np.uint64(k * stride)]
    top = float32(peak(logs, 0, count))
    if not top > NOTHING:
        return -np.inf
    total = float32(0.0)
    for k in range(count):
        total += exp(float32(logs[k] - top))
    return float(math.log(total) + top)


@kernel("void(float32[:, ::1], float32[::1], int64, float32, float32, float32, float32, float32[:, ::1])")
def displace(
    columns: Float32Array,
    weights: Float32Array,
    particles: int,
    scale: float,
    forward: float,
    right: float,
    turn: float,
    out: Float32Array,
) -> None:
    """Write north, east, heading, weight of particles evenly spaced among ``particles``, displaced."""
    rows = out.shape[0]
    for k in range(rows):
        i = k * particles // rows
        sine_heading, cosine_heading = sincos(columns[2, i])
        out[k, 0] = columns[0, i] + forward * cosine_heading - right * sine_heading
        out[k, 1] = columns[1, i] + forward * sine_heading + right * cosine_heading
        out[k, 2] = wrapped(float32(columns[2, i] + turn))
        out[k, 3] = weights[i] * scale
