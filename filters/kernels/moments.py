"""Weighted sums over a displaced particle set, block by block, and the moments that they come to.

Squares are summed in single precision, so they are taken about a *reference* near the mean: the belief's centre,
displaced as the particles are. Each block has a row of sums of its own, and the rows are added in order, so the result
does not depend on who summed which block. :func:`finish` says whether the reference was near enough.
"""

from __future__ import annotations

import math

import numpy as np
from numpy import float32, float64, int32
from numpy.typing import NDArray

from filters.kernels.compile import Float32Array, function, kernel
from filters.kernels.elementary import bits, real, sincos, wrapped

Float64Array = NDArray[np.float64]
Int64Array = NDArray[np.int64]

# Where each sum is kept. With w the weight, n, e, h the offsets from the reference, and a the heading:
# w, w·n, w·e, w·h, w·sin a, w·cos a, w·n², w·n·e, w·e², w·n·h, w·e·h, w·h²; the last is the largest |h|.
SUMS = 13
POSE = 3

REFERENCE = 5
"""North, east and heading of the reference, the turn, and how often the sums were taken anew."""

FAR = 1e4
"""Square of the mean's distance from the reference over the variance; four digits of seven are lost."""


@function
def principal(angle: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@kernel("void(float32[:, ::1], float64, float64, float64, float64[::1])")
def displace_reference(
    centre: Float32Array, forward: float, right: float, turn: float, reference: Float64Array
) -> None:
    """Displace the centre, (dimension, 1), along its own heading, and round it as the sums will see it."""
    heading = float64(centre[2, 0])
    sine, cosine = math.sin(heading), math.cos(heading)
    reference[0] = float32(centre[0, 0] + forward * cosine - right * sine)
    reference[1] = float32(centre[1, 0] + forward * sine + right * cosine)
    reference[2] = float32(heading + turn)
    reference[3] = turn
    reference[4] = 0.0


@kernel("void(float32[:, ::1], float32[::1], int64, int64, float32, float32, float64[::1], float64[::1])")
def sum_pose(
    columns: Float32Array,
    weights: Float32Array,
    first: int,
    last: int,
    forward: float,
    right: float,
    reference: Float64Array,
    sums: Float64Array,
) -> None:
    """Displace the particles of one block, each along its own heading; write the sums of the pose."""
    north = columns[0, first:last]
    east = columns[1, first:last]
    heading = columns[2, first:last]
    weight = weights[first:last]
    north_reference = float32(reference[0])
    east_reference = float32(reference[1])
    turned = float32(reference[3] - reference[2])
    s0 = s1 = s2 = s3 = s4 = s5 = s6 = s7 = s8 = s9 = s10 = s11 = float32(0.0)
    widest = int32(0)
    for i in range(last - first):
        w = weight[i]
        sine, cosine = sincos(heading[i])
        n = float32(float32(north[i] - north_reference) + forward * cosine - right * sine)
        e = float32(float32(east[i] - east_reference) + forward * sine + right * cosine)
        h = wrapped(float32(heading[i] + turned))
        widest = max(widest, int32(bits(h) & int32(0x7FFFFFFF)))
        wn = float32(w * n)
        we = float32(w * e)
        wh = float32(w * h)
        s0 += w
        s1 += wn
        s2 += we
        s3 += wh
        s4 += w * sine
        s5 += w * cosine
        s6 += wn * n
        s7 += wn * e
        s8 += we * e
        s9 += wn * h
        s10 += we * h
        s11 += wh * h
    sums[0] = s0
    sums[1] = s1
    sums[2] = s2
    sums[3] = s3
    sums[4] = s4
    sums[5] = s5
    sums[6] = s6
    sums[7] = s7
    sums[8] = s8
    sums[9] = s9
    sums[10] = s10
    sums[11] = s11
    sums[12] = real(widest)


@kernel("void(float32[:, ::1], float32[::1], int64, int64, float32[:, ::1], float64[::1])")
def sum_slow(
    columns: Float32Array,
    weights: Float32Array,
    first: int,
    last: int,
    centre: Float32Array,
    sums: Float64Array,
) -> None:
    """Write the weighted offset, and its square, of each column beside the pose behind the pose's sums."""
    weight = weights[first:last]
    for row in range(POSE, columns.shape[0]):
        column = columns[row, first:last]
        reference = centre[row, 0]
        offset = float32(0.0)
        square = float32(0.0)
        for i in range(last - first):
            x = float32(column[i] - reference)
            wx = float32(weight[i] * x)
            offset += wx
            square += wx * x
        sums[SUMS + 2 * (row - POSE)] = offset
        sums[SUMS + 2 * (row - POSE) + 1] = square


@kernel(
    "void(float32[:, ::1], float32[::1], int64[::1], int64, int64, float64, float64, float32[:, ::1],"
    "float64[::1], float64[:, ::1])"
)
def sum_blocks(
    columns: Float32Array,
    weights: Float32Array,
    bounds: Int64Array,
    first_block: int,
    last_block: int,
    forward: float,
    right: float,
    centre: Float32Array,
    reference: Float64Array,
    sums: Float64Array,
) -> None:
    """Sum over some blocks, a row for each; block b lies from ``bounds[b]`` to ``bounds[b + 1]``."""
    for block in range(first_block, last_block):
        first, last = bounds[block], bounds[block + 1]
        sum_pose(columns, weights, first, last, forward, right, reference, sums[block])
        sum_slow(columns, weights, first, last, centre, sums[block])


@kernel(
    "boolean(int64, float64, float64, float32[:, ::1], float64[::1], float64[:, ::1], float64[::1], float64[::1],"
    "float64[:, ::1])"
)
def finish(
    blocks: int,
    forward: float,
    right: float,
    centre: Float32Array,
    reference: Float64Array,
    sums: Float64Array,
    mean: Float64Array,
    variance: Float64Array,
    covariance: Float64Array,
) -> bool:
    """Make moments of the sums and move the centre to the mean; false if they must be taken anew.

    The mean and the variance of each dimension, and the pose's covariance. Anew, about the
    reference that is set then: when some particle's heading wraps elsewhere about the mean than about the reference,
    and when the belief has jumped, so that no digits are left for its spread.
    """
    total = sums[0]
    for block in range(1, blocks):
        widest = max(total[12], sums[block, 12])
        for k in range(total.size):
            total[k] += sums[block, k]
        total[12] = widest
    weight = total[0]
    turn = reference[3]
    # the heading's sums stand still in space: turn them until the reference is zero
    sine, cosine = math.sin(turn - reference[2]), math.cos(turn - reference[2])
    offset = math.atan2(total[4] * cosine + total[5] * sine, total[5] * cosine - total[4] * sine)
    if reference[4] == 0.0 and abs(offset) > 1e-6 and total[12] + abs(offset) >= 3.14:
        reference[2] += offset
        reference[4] = 1.0
        return False
    n, e, h = total[1] / weight, total[2] / weight, total[3] / weight
    nn = total[6] / weight - n * n
    ee = total[8] / weight - e * e
    if reference[4] < 2.0 and n * n + e * e > FAR * (nn + ee):
        heading = reference[2]
        centre[0, 0] += n
        centre[1, 0] += e
        displace_reference(centre, forward, right, turn, reference)
        reference[2] = heading
        reference[4] = 2.0
        return False
    nn, ee = max(nn, 0.0), max(ee, 0.0)
    hh = max(total[11] / weight - 2.0 * offset * h + offset * offset, 0.0)
    ne = total[7] / weight - n * e
    ne = math.copysign(min(abs(ne), math.sqrt(nn * ee)), ne)  # rounding: few particles lie on a line
    nh, eh = total[9] / weight - n * h, total[10] / weight - e * h
    mean_heading = reference[2] + offset
    mean[0] = reference[0] + n
    mean[1] = reference[1] + e
    mean[2] = principal(mean_heading)
    centre[0, 0] += n
    centre[1, 0] += e
    centre[2, 0] = principal(mean_heading - turn)
    variance[0], variance[1], variance[2] = nn, ee, hh
    for row in range(POSE, centre.shape[0]):
        away = total[SUMS + 2 * (row - POSE)] / weight
        square = total[SUMS + 2 * (row - POSE) + 1] / weight
        mean[row] = centre[row, 0] + away
        centre[row, 0] = mean[row]
        variance[row] = max(square - away * away, 0.0)
    covariance[0, 0], covariance[0, 1], covariance[0, 2] = nn, ne, nh
    covariance[1, 0], covariance[1, 1], covariance[1, 2] = ne, ee, eh
    covariance[2, 0], covariance[2, 1], covariance[2, 2] = nh, eh, hh
    return True


@kernel(
    "void(float32[:, ::1], float32[::1], int64[::1], float64, float64, float64, float32[:, ::1], float64[::1],"
    "float64[:, ::1], float64[::1], float64[::1], float64[:, ::1])"
)
def summarize(
    columns: Float32Array,
    weights: Float32Array,
    bounds: Int64Array,
    forward: float,
    right: float,
    turn: float,
    centre: Float32Array,
    reference: Float64Array,
    sums: Float64Array,
    mean: Float64Array,
    variance: Float64Array,
    covariance: Float64Array,
) -> None:
    """All of it in one call, for one thread: the reference, the blocks' sums, and their moments."""
    blocks = bounds.size - 1
    displace_reference(centre, forward, right, turn, reference)
    done = False
    while not done:
        sum_blocks(columns, weights, bounds, 0, blocks, forward, right, centre, reference, sums)
        done = finish(blocks, forward, right, centre, reference, sums, mean, variance, covariance)
