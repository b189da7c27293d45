"""Sums over the particles of each label, displaced.

A block is gone over once for each label, with the weights of the others zero: so the sums stay in vector registers,
in single precision about a reference that is near the label's mean, and are added in double precision.
"""

from __future__ import annotations

import numpy as np
from numpy import float32, float64
from numpy.typing import NDArray

from filters.kernels.compile import Float32Array, Int32Array, kernel
from filters.kernels.elementary import sincos, wrapped

Float64Array = NDArray[np.float64]

BLOCK = 8192
"""Particles that are summed in single precision."""

POSE_SUMS = 12
"""w; w n, w e, w h; w sin h, w cos h; w n², w n e, w e², w n h, w e h, w h²: offsets from the label's reference."""


@kernel("void(float32[::1], int32[::1], int64, float64[::1])", exact=True)
def masses(weights: Float32Array, labels: Int32Array, count: int, sums: Float64Array) -> None:
    """Write each label's sum of weights."""
    sums[:] = 0.0
    for i in range(count):
        sums[labels[i]] += float64(weights[i])


@kernel(
    "void(float32[:, ::1], float32[::1], int32[::1], int64, int64, int32, float32, float32, float32, float64[::1],"
    "float64[::1])"
)
def add_block(
    columns: Float32Array,
    weights: Float32Array,
    labels: Int32Array,
    first: int,
    last: int,
    label: int,
    forward: float,
    right: float,
    turn: float,
    about: Float64Array,
    sums: Float64Array,
) -> None:
    """Displace the particles of a block, each along its own heading, and add those of one label to its sums.

    Offsets are from ``about``, near the label's mean; sine and cosine are those of the heading's offset.
    """
    north, east, heading = columns[0, first:last], columns[1, first:last], columns[2, first:last]
    weight, mine = weights[first:last], labels[first:last]
    north_about, east_about = float32(about[0]), float32(about[1])
    turned = float32(turn - about[2])
    s0 = s1 = s2 = s3 = s4 = s5 = s6 = s7 = s8 = s9 = s10 = s11 = float32(0.0)
    for i in range(last - first):
        w = weight[i] if mine[i] == label else float32(0.0)
        sine, cosine = sincos(heading[i])
        n = float32(float32(north[i] - north_about) + forward * cosine - right * sine)
        e = float32(float32(east[i] - east_about) + forward * sine + right * cosine)
        h = wrapped(float32(heading[i] + turned))
        across, along = sincos(h)
        wn, we, wh = float32(w * n), float32(w * e), float32(w * h)
        s0 += w
        s1 += wn
        s2 += we
        s3 += wh
        s4 += w * across
        s5 += w * along
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
    for row in range(3, columns.shape[0]):
        column = columns[row, first:last]
        reference = float32(about[row])
        offset = square = float32(0.0)
        for i in range(last - first):
            w = weight[i] if mine[i] == label else float32(0.0)
            x = float32(column[i] - reference)
            wx = float32(w * x)
            offset += wx
            square += wx * x
        sums[POSE_SUMS + 2 * (row - 3)] += offset
        sums[POSE_SUMS + 2 * (row - 3) + 1] += square


@kernel(
    "void(float32[:, ::1], float32[::1], int32[::1], int64, int64[::1], float64, float64, float64, float64[:, ::1],"
    "float64[:, ::1])"
)
def moments(
    columns: Float32Array,
    weights: Float32Array,
    labels: Int32Array,
    count: int,
    asked: NDArray[np.int64],
    forward: float,
    right: float,
    turn: float,
    references: Float64Array,
    sums: Float64Array,
) -> None:
    """Sum the particles of the labels asked for, each into its row of ``sums``, about its row of ``references``.

    Behind the pose's sums stand w x and w x² for every other column.
    """
    sums[:] = 0.0
    for first in range(0, count, BLOCK):
        last = min(first + BLOCK, count)
        for k in asked:
            add_block(
                columns,
                weights,
                labels,
                first,
                last,
                k,
                forward,
                right,
                turn,
                references[k],
                sums[k],
            )
