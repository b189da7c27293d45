"""Clusters of particles in columns: which cluster each belongs to, and the sums over each cluster.

Distances are z'z with z = F (x - centre), F lower triangular: a scaling for k-means, the inverse root of a
cluster's covariance for its refinement. They run block by block over rows of scratch in the first-level cache,
so that every inner loop vectorises. Second moments are summed in float64; first moments, which only steer the
search, in float32 registers over a block.
"""

from __future__ import annotations

import math

import numpy as np
from numpy import float32, float64, int32
from numpy.typing import NDArray

from filters.kernels.compile import Float32Array, Int32Array, kernel
from filters.kernels.elementary import sincos, wrapped

Float64Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

TURN = 2.0 * math.pi


@kernel("void(float32[:, ::1], float32[::1], int64, float32[:, ::1], float32[::1])")
def sample(
    columns: Float32Array, weights: Float32Array, count: int, some: Float32Array, some_weights: Float32Array
) -> None:
    """Take ``some_weights.size`` particles, evenly spaced among ``count``."""
    size = some_weights.size
    for j in range(some.shape[0]):
        source = columns[j]
        target = some[j]
        for k in range(size):
            target[k] = source[k * count // size]
    for k in range(size):
        some_weights[k] = weights[k * count // size]


@kernel(
    "void(float32[:, ::1], int64, int64, float32[:, ::1], float32[:, :, ::1], float32[::1], boolean[::1],"
    "float32[:, ::1], float32[::1], int32[::1])"
)
def assign(  # noqa: C901  the loops of one pass, each a line or two
    columns: Float32Array,
    first: int,
    last: int,
    centres: Float32Array,
    factors: Float32Array,
    constants: Float32Array,
    circular: Flags,
    scratch: Float32Array,
    costs: Float32Array,
    labels: Int32Array,
) -> None:
    """Write for the particles ``first`` to ``last`` the least of z'z + constant over clusters, and whose it is.

    ``scratch`` has two rows more than there are dimensions; its width is the block.
    """
    size = centres.shape[1]
    width = scratch.shape[1]
    part = scratch[size]
    total = scratch[size + 1]
    for start in range(first, last, width):
        wide = min(width, last - start)
        best = costs[start - first : start - first + wide]
        label = labels[start - first : start - first + wide]
        for k in range(centres.shape[0]):
            for i in range(wide):
                total[i] = constants[k]
            for j in range(size):
                row = columns[j, start : start + wide]
                away = scratch[j]
                centre = centres[k, j]
                if circular[j]:
                    for i in range(wide):
                        away[i] = wrapped(float32(row[i] - centre))
                else:
                    for i in range(wide):
                        away[i] = row[i] - centre
                scale = factors[k, j, j]
                for i in range(wide):
                    part[i] = scale * away[i]
                for m in range(j):
                    scale = factors[k, j, m]
                    if scale != float32(0.0):
                        other = scratch[m]
                        for i in range(wide):
                            part[i] += scale * other[i]
                for i in range(wide):
                    total[i] += part[i] * part[i]
            if k == 0:
                for i in range(wide):
                    best[i] = total[i]
                    label[i] = int32(0)
            else:
                mine = int32(k)
                for i in range(wide):
                    nearer = total[i] < best[i]
                    best[i] = total[i] if nearer else best[i]
                    label[i] = mine if nearer else label[i]


@kernel(
    "void(float32[:, ::1], float32[::1], int64, int64, int32[::1], float32[:, ::1], boolean[::1], float64[:, ::1])"
)
def first_moments(
    columns: Float32Array,
    weights: Float32Array,
    first: int,
    last: int,
    labels: Int32Array,
    centres: Float32Array,
    circular: Flags,
    sums: Float64Array,
) -> None:
    """Add to each cluster's row of ``sums``: Σ w, then Σ w d for every dimension, d the way from the centre."""
    heavy = weights[first:last]
    for k in range(centres.shape[0]):
        total = float32(0.0)
        for i in range(last - first):
            total += heavy[i] if labels[i] == k else float32(0.0)
        sums[k, 0] += total
        for j in range(centres.shape[1]):
            row = columns[j, first:last]
            centre = centres[k, j]
            total = float32(0.0)
            if circular[j]:
                for i in range(last - first):
                    weight = heavy[i] if labels[i] == k else float32(0.0)
                    total += weight * wrapped(float32(row[i] - centre))
            else:
                for i in range(last - first):
                    weight = heavy[i] if labels[i] == k else float32(0.0)
                    total += weight * float32(row[i] - centre)
            sums[k, 1 + j] += total


@kernel(
    "void(float32[:, ::1], float32[::1], int64, int64, int32[::1], float32[:, ::1], boolean[::1], float64[:, ::1],"
    "float64[::1])"
)
def second_moments(
    columns: Float32Array,
    weights: Float32Array,
    first: int,
    last: int,
    labels: Int32Array,
    centres: Float32Array,
    circular: Flags,
    sums: Float64Array,
    away: Float64Array,
) -> None:
    """Add to each cluster's row of ``sums``: Σ w; Σ w d; Σ w sin d and Σ w cos d; Σ w d dᵀ, its lower triangle.

    The places: 1, d, d, d, d (d + 1) / 2 for d dimensions. Sine and cosine only where a dimension wraps; angles
    lie in [-pi, pi].
    ``away``: room for d numbers.
    """
    size = centres.shape[1]
    for i in range(first, last):
        k = labels[i - first]
        weight = float64(weights[i])
        row = sums[k]
        row[0] += weight
        place = 1 + 3 * size
        for j in range(size):
            step = float64(columns[j, i]) - float64(centres[k, j])
            if circular[j]:
                if step > math.pi:
                    step -= TURN
                elif step < -math.pi:
                    step += TURN
                s, c = sincos(float32(step))
                row[1 + size + j] += weight * s
                row[1 + 2 * size + j] += weight * c
            away[j] = step
            product = weight * away[j]
            row[1 + j] += product
            for m in range(j + 1):
                row[place] += product * away[m]
                place += 1
