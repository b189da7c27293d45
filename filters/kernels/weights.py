"""Importance weights: from log weights to weights, and the sums over them.

Sums over a block run in float32 registers (32,768 terms at most) and are carried on in float64 from block to
block, in arrays that the caller owns. The largest log weight is found as an integer, because a float maximum
does not vectorise.
"""

from __future__ import annotations

import math

import numpy as np
from numpy import float32, int32
from numpy.typing import NDArray

from filters.kernels.compile import Float32Array, kernel
from filters.kernels.elementary import cosine, exp, from_order, order, sincos, sine, wrapped

Float64Array = NDArray[np.float64]

# Where each sum of `moments` is kept. With w the weight, n, e, h the offsets from the reference:
# w, w·n, w·e, w·h, w·sin h, w·cos h, w·n², w·n·e, w·e², w·n·h, w·e·h, w·h²; the last is the largest |h|.
SUMS = 13

NOTHING = float32(-1e30)
"""A log weight from here down is that of a particle which cannot be."""


@kernel("float32(float32[::1], int64, int64)")
def peak(log_weights: Float32Array, first: int, last: int) -> np.float32:
    """Largest log weight of a block.

    NaN orders by its sign bit: a positive one above infinity, a negative one (what processors make) below all, and
    `exponentiate` gives it no weight.
    """
    largest = int32(-2147483647)
    logs = log_weights[first:last]
    for i in range(last - first):
        largest = max(largest, order(logs[i]))
    return from_order(largest)


@kernel("void(float32[::1], float32[::1], int64, int64, float32, float64[::1])")
def exponentiate(
    log_weights: Float32Array, weights: Float32Array, first: int, last: int, top: float, sums: Float64Array
) -> None:
    """Take ``top`` off the log weights, write the weights, and add their sum and squares to ``sums``."""
    logs = log_weights[first:last]
    out = weights[first:last]
    total = float32(0.0)
    squares = float32(0.0)
    for i in range(last - first):
        log_weight = float32(logs[i] - top)
        weight = exp(log_weight)
        logs[i] = log_weight
        out[i] = weight
        total += weight
        squares += weight * weight
    sums[0] += total
    sums[1] += squares


@kernel("float64(float32[::1], int64, float32[::1])")
def log_sum(log_weights: Float32Array, stride: int, sample: Float32Array) -> float:
    """Logarithm of the sum of the weights of every ``stride``-th particle; minus infinity if all are zero.

    ``sample`` takes them: a strided loop does not vectorise.
    """
    count = sample.size
    for k in range(count):
        sample[k] = log_weights[np.uint64(k * stride)]
    largest = int32(-2147483647)
    for k in range(count):
        largest = max(largest, order(sample[k]))
    top = from_order(largest)
    if not top > NOTHING:
        return -np.inf
    total = float32(0.0)
    for k in range(count):
        total += exp(float32(sample[k] - top))
    return float(math.log(total) + top)


@kernel(
    "void(float32[:, ::1], float32[::1], int64, int64, float32, float32, float32, float32, float32, float32,"
    "float64[::1])"
)
def moments(
    columns: Float32Array,
    weights: Float32Array,
    first: int,
    last: int,
    forward: float,
    right: float,
    turn: float,
    north_reference: float,
    east_reference: float,
    heading_reference: float,
    sums: Float64Array,
) -> None:
    """Displace every particle along its own heading; add its weighted offsets and products to ``sums``."""
    north = columns[0, first:last]
    east = columns[1, first:last]
    heading = columns[2, first:last]
    weight = weights[first:last]
    s0 = s1 = s2 = s3 = s4 = s5 = s6 = s7 = s8 = s9 = s10 = s11 = float32(0.0)
    widest = int32(0)
    for i in range(last - first):
        w = weight[i]
        sine_heading, cosine_heading = sincos(heading[i])
        n = float32(north[i] - north_reference + forward * cosine_heading - right * sine_heading)
        e = float32(east[i] - east_reference + forward * sine_heading + right * cosine_heading)
        h = wrapped(float32(heading[i] + turn - heading_reference))
        half_sine = sine(float32(float32(0.5) * h))
        half_cosine = cosine(float32(float32(0.5) * h))
        widest = max(widest, order(float32(abs(h))))
        wn = float32(w * n)
        we = float32(w * e)
        wh = float32(w * h)
        s0 += w
        s1 += wn
        s2 += we
        s3 += wh
        s4 += w * float32(float32(2.0) * half_sine * half_cosine)
        s5 += w * float32(float32(1.0) - float32(2.0) * half_sine * half_sine)
        s6 += wn * n
        s7 += wn * e
        s8 += we * e
        s9 += wn * h
        s10 += we * h
        s11 += wh * h
    sums[0] += s0
    sums[1] += s1
    sums[2] += s2
    sums[3] += s3
    sums[4] += s4
    sums[5] += s5
    sums[6] += s6
    sums[7] += s7
    sums[8] += s8
    sums[9] += s9
    sums[10] += s10
    sums[11] += s11
    sums[12] = max(sums[12], from_order(widest))


@kernel("void(float32[:, ::1], float32[::1], int64, int64, float32[:, ::1], float64[::1])")
def spread(
    columns: Float32Array,
    weights: Float32Array,
    first: int,
    last: int,
    references: Float32Array,
    sums: Float64Array,
) -> None:
    """Add the weighted offset, and its square, of each column beside the pose behind the pose's sums."""
    weight = weights[first:last]
    for row in range(3, columns.shape[0]):
        column = columns[row, first:last]
        reference = references[row, 0]
        offset = float32(0.0)
        square = float32(0.0)
        for i in range(last - first):
            x = float32(column[i] - reference)
            wx = float32(weight[i] * x)
            offset += wx
            square += wx * x
        sums[SUMS + 2 * (row - 3)] += offset
        sums[SUMS + 2 * (row - 3) + 1] += square


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
