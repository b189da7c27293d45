"""Moving probability between the cells of a grid, and the Gaussian's probability of an interval."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from filters.kernels.compile import kernel

Float64Array = NDArray[np.float64]
Int64Array = NDArray[np.int64]


@kernel("void(float64[::1], float64[::1], float64[::1])", exact=True)
def probability_between(lower: Float64Array, upper: Float64Array, probability: Float64Array) -> None:
    """Standard normal probability of each interval.

    Taken in the tail that the interval lies in, so that small probabilities keep their digits.
    """
    root = math.sqrt(0.5)
    for i in range(lower.size):
        a, b = lower[i], upper[i]
        if a > 0.0:
            a, b = -b, -a
        probability[i] = 0.5 * (math.erfc(-b * root) - math.erfc(-a * root))


@kernel("float64(float64[:, :, ::1], int64[:, :, ::1], float64[:, :, ::1], float64[:, :, ::1])")
def spread(source: Float64Array, places: Int64Array, shares: Float64Array, target: Float64Array) -> float:
    """Move probability along the middle axis; what is left over beyond its ends is summed and returned.

    ``places[o, k]`` says where the probability of ``source[o, k, :]`` goes, -1 beyond the ends, and
    ``shares[o, k]`` how much of it. ``target`` is overwritten.
    """
    target[:] = 0.0
    departed = 0.0
    for o in range(source.shape[0]):
        for k in range(source.shape[1]):
            row = source[o, k]
            mass = 0.0
            for i in range(row.size):
                mass += row[i]
            if mass == 0.0:
                continue
            for w in range(places.shape[2]):
                share = shares[o, k, w]
                place = places[o, k, w]
                if place < 0:
                    departed += share * mass
                else:
                    goal = target[o, place]
                    for i in range(row.size):
                        goal[i] += share * row[i]
    return departed


@kernel(
    "float64(float64[::1], int64[:, ::1], float64[:, ::1], int64[:, ::1], float64[:, ::1],"
    "int64[:, ::1], float64[:, ::1], int64[:, ::1], float64[:, ::1], float64[::1])"
)
def scatter(
    masses: Float64Array,
    first: Int64Array,
    first_share: Float64Array,
    second: Int64Array,
    second_share: Float64Array,
    third: Int64Array,
    third_share: Float64Array,
    fourth: Int64Array,
    fourth_share: Float64Array,
    target: Float64Array,
) -> float:
    """Add the probability of each source to the product of four windows; return what lies beyond the grid.

    The windows hold flat offsets along their axes, -1 beyond the ends; the shares of each row sum to one.
    """
    departed = 0.0
    for i in range(masses.size):
        for a in range(first.shape[1]):
            p = masses[i] * first_share[i, a]
            if first[i, a] < 0:
                departed += p
                continue
            for b in range(second.shape[1]):
                q = p * second_share[i, b]
                if second[i, b] < 0:
                    departed += q
                    continue
                for c in range(third.shape[1]):
                    r = q * third_share[i, c]
                    if third[i, c] < 0:
                        departed += r
                        continue
                    place = first[i, a] + second[i, b] + third[i, c]
                    for d in range(fourth.shape[1]):
                        if fourth[i, d] < 0:
                            departed += r * fourth_share[i, d]
                        else:
                            target[place + fourth[i, d]] += r * fourth_share[i, d]
    return departed
