"""Sums over the particles of each label, displaced; in float64, because labels may lie far from each other."""

from __future__ import annotations

import numpy as np
from numpy import float32, float64
from numpy.typing import NDArray

from filters.kernels.compile import Float32Array, Int32Array, kernel
from filters.kernels.elementary import sincos, wrapped

Float64Array = NDArray[np.float64]

POSE_SUMS = 12
"""w; w n, w e, w h; w sin h, w cos h; w n², w n e, w e², w n h, w e h, w h²: offsets from the label's reference."""


@kernel("void(float32[::1], int32[::1], int64, float64[::1])", exact=True)
def masses(weights: Float32Array, labels: Int32Array, count: int, sums: Float64Array) -> None:
    """Write each label's sum of weights."""
    sums[:] = 0.0
    for i in range(count):
        sums[labels[i]] += float64(weights[i])


@kernel(
    "void(float32[:, ::1], float32[::1], int32[::1], int64, float64, float64, float64, float64[:, ::1],"
    "float64[:, ::1])"
)
def moments(
    columns: Float32Array,
    weights: Float32Array,
    labels: Int32Array,
    count: int,
    forward: float,
    right: float,
    turn: float,
    references: Float64Array,
    sums: Float64Array,
) -> None:
    """Displace the particles, each along its own heading, and sum each label's into its row of ``sums``.

    Sine and cosine are those of the heading's offset from the reference. Behind the pose's sums stand w x and w x² for
    every other column, offsets from the label's reference too.
    """
    sums[:] = 0.0
    rows = columns.shape[0]
    for i in range(count):
        k = labels[i]
        total, about = sums[k], references[k]
        w = float64(weights[i])
        sine, cosine = sincos(columns[2, i])
        n = float64(columns[0, i]) + forward * cosine - right * sine - about[0]
        e = float64(columns[1, i]) + forward * sine + right * cosine - about[1]
        offset = wrapped(float32(float64(columns[2, i]) + turn - about[2]))
        across, along = sincos(offset)
        h = float64(offset)
        total[0] += w
        total[1] += w * n
        total[2] += w * e
        total[3] += w * h
        total[4] += w * across
        total[5] += w * along
        total[6] += w * n * n
        total[7] += w * n * e
        total[8] += w * e * e
        total[9] += w * n * h
        total[10] += w * e * h
        total[11] += w * h * h
        for row in range(3, rows):
            x = float64(columns[row, i]) - about[row]
            total[POSE_SUMS + 2 * (row - 3)] += w * x
            total[POSE_SUMS + 2 * (row - 3) + 1] += w * x * x
