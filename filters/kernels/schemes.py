"""The resampling schemes that need a random number per draw, each one pass over the sources.

The numbers are counter-based, as the normals are (:mod:`filters.kernels.random`): number ``i`` is pcg3d's hash of
the counter and of two words of key, 53 bits of it in (0, 1). So none is stored, and a pass that needs them twice
makes them twice. Sums run in float64, in the order written.
"""

from __future__ import annotations

import math

import numpy as np
from numpy import float64, int64, uint32
from numpy.typing import NDArray

from filters.kernels.compile import Float32Array, Int32Array, function, kernel
from filters.kernels.random import hash3

Float64Array = NDArray[np.float64]

_HIGH = np.float64(2.0**26)
_UNIT = np.float64(2.0**-53)


@function
def number(i: int, key: int, other_key: int) -> float:
    """The ``i``-th uniform number in (0, 1)."""
    p, q, _ = hash3(uint32(i), uint32(key), uint32(other_key))
    high = float64(int64(uint32(p) >> uint32(5)))
    low = float64(int64(uint32(q) >> uint32(6)))
    return (high * _HIGH + low + 0.5) * _UNIT


@function
def spacing(i: int, key: int, other_key: int) -> float:
    """The ``i``-th exponential number: gaps between sorted uniforms are such, over their sum."""
    return -math.log(number(i, key, other_key))


@kernel("void(uint32, uint32, float64[::1])", exact=True)
def numbers(key: int, other_key: int, out: Float64Array) -> None:
    """Write the first numbers of a key."""
    for i in range(out.size):
        out[i] = number(i, key, other_key)


@function
def last_weighted(weights: Float32Array) -> int:
    """Index of the last source that has weight: what rounding leaves over is its."""
    i = weights.size - 1
    while i > 0 and weights[i] <= 0.0:
        i -= 1
    return i


@kernel("void(float32[::1], float64, uint32, uint32, int32[::1])", exact=True)
def multinomial(weights: Float32Array, total: float, key: int, other_key: int, ancestors: Int32Array) -> None:
    """Independent draws (Table 4.3, line 9) in ascending order, without sorting them.

    The m-th smallest of N uniforms has the distribution of S_m / S_{N+1}, S being sums of N + 1 exponential numbers.
    """
    count = ancestors.size
    whole = 0.0
    for m in range(count + 1):
        whole += spacing(m, key, other_key)
    scale = total / whole
    last = last_weighted(weights)
    i = 0
    cumulative = float64(weights[0])
    gone = 0.0
    for m in range(count):
        gone += spacing(m, key, other_key)
        place = gone * scale
        while place > cumulative and i < last:
            i += 1
            cumulative += float64(weights[i])
        ancestors[m] = i


@kernel("void(float32[::1], float64, uint32, uint32, int32[::1])", exact=True)
def stratified(weights: Float32Array, total: float, key: int, other_key: int, ancestors: Int32Array) -> None:
    """One draw from each of N equal stretches of the cumulative weight."""
    count = ancestors.size
    step = total / count
    last = last_weighted(weights)
    i = 0
    cumulative = float64(weights[0])
    for m in range(count):
        place = (m + number(m, key, other_key)) * step
        while place > cumulative and i < last:
            i += 1
            cumulative += float64(weights[i])
        ancestors[m] = i


@kernel("void(float32[::1], float64, uint32, uint32, int32[::1])", exact=True)
def residual(weights: Float32Array, total: float, key: int, other_key: int, ancestors: Int32Array) -> None:
    """Copy source i floor(N w_i) times, then draw the rest independently from the remainders N w_i - floor(N w_i)."""
    count = ancestors.size
    scale = count / total
    certain = 0
    remainder = 0.0
    last = last_weighted(weights)
    fractional = -1
    for i in range(weights.size):
        expected = float64(weights[i]) * scale
        copies = math.floor(expected)
        certain += int64(copies)
        remainder += expected - copies
        if expected > copies:
            fractional = i
    if fractional >= 0:
        last = fractional
    rest = max(0, count - certain)
    whole = 0.0
    for m in range(rest + 1):
        whole += spacing(m, key, other_key)
    draw_scale = remainder / whole
    drawn = 0
    place = spacing(0, key, other_key) * draw_scale
    cumulative = 0.0
    m = 0
    for i in range(weights.size):
        expected = float64(weights[i]) * scale
        copies = math.floor(expected)
        cumulative += expected - copies
        end = min(count, m + int64(copies))
        while drawn < rest and (place <= cumulative or i == last):
            end = min(count, end + 1)
            drawn += 1
            place += spacing(drawn, key, other_key) * draw_scale
        while m < end:
            ancestors[m] = i
            m += 1


@kernel("void(float32[::1], int32[::1], int64[::1], float64[::1], float64[::1], int32[::1])", exact=True)
def within(
    weights: Float32Array,
    labels: Int32Array,
    quotas: NDArray[np.int64],
    masses: Float64Array,
    uniforms: Float64Array,
    ancestors: Int32Array,
) -> None:
    """Draw each label's quota among its own sources by Table 4.4, all labels in one pass.

    ``masses`` are the labels' sums of weight and ``uniforms`` their random numbers in (0, 1].
    """
    hypotheses = quotas.size
    cumulative = np.zeros(hypotheses)
    ends = np.zeros(hypotheses, np.int64)
    last = np.zeros(hypotheses, np.int64)
    for i in range(weights.size):
        if weights[i] > 0.0:
            last[labels[i]] = i
    m = 0
    for i in range(weights.size):
        label = labels[i]
        quota = quotas[label]
        if quota == 0 or weights[i] <= 0.0:
            continue
        cumulative[label] += float64(weights[i])
        end = min(quota, int64(cumulative[label] * (quota / masses[label]) + 1.0 - uniforms[label]))
        if i == last[label]:
            end = quota
        for _ in range(end - ends[label]):
            ancestors[m] = i
            m += 1
        ends[label] = end
