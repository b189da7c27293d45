"""Systematic resampling: where the copies come from, and where they are laid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from filters.kernels.compile import Float32Array, Int32Array, kernel


@kernel("float64(float32[::1])")
def total(weights: Float32Array) -> float:
    """Sum of the weights in float64."""
    s = np.float64(0.0)
    for i in range(weights.size):
        s += np.float64(weights[i])
    return s


@kernel("void(float32[::1], float64, float64, int32[::1])", exact=True)
def systematic(weights: Float32Array, total: float, uniform: float, ancestors: Int32Array) -> None:
    """Table 4.4, with the loops the other way round: each source marks where its first copy goes.

    Source i takes the positions m with c(i-1) < (uniform + m) / count <= c(i), c being the cumulative weight;
    so the first position after it is floor(c · count - uniform) + 1. A running maximum then fills the gaps.
    What rounding leaves between the last cumulative weight and the total goes to the last source that has
    weight.
    """
    count = ancestors.size
    for m in range(count):
        ancestors[m] = 0
    scale = count / total
    cumulative = 0.0
    end = 0
    for i in range(weights.size):
        if end < count:  # a source without a copy is overwritten by the next
            ancestors[np.uint64(end)] = i
        cumulative += np.float64(weights[i])
        end = min(count, int(cumulative * scale + 1.0 - uniform))
    if end < count:
        i = weights.size - 1
        while weights[i] <= 0.0:
            i -= 1
        ancestors[end] = i
    latest = np.int32(0)
    for m in range(count):
        ahead = np.int32(ancestors[m] - latest)  # a maximum without a branch, which none could predict
        latest = np.int32(latest + np.int32(ahead & ~np.int32(ahead >> np.int32(31))))
        ancestors[m] = latest


@kernel("void(int64[::1], int32[::1])", exact=True)
def places(starts: NDArray[np.int64], places: Int32Array) -> None:
    """Say where each copy is laid: dealt to the blocks in turn, like cards, so that each gets a fair sample.

    Ancestors ascend; laid down in a row, the first block would hold only the first ancestors' copies.
    ``starts`` are the blocks' first places; earlier blocks may be larger by one.
    """
    blocks = starts.size
    rounds = places.size // blocks
    m = 0
    for position in range(rounds):
        for block in range(blocks):
            places[m] = starts[block] + position
            m += 1
    for block in range(places.size - m):
        places[m] = starts[block] + rounds
        m += 1


@kernel("void(float32[:, ::1], float32[:, ::1], int32[::1], int32[::1])", exact=True)
def deal(source: Float32Array, target: Float32Array, ancestors: Int32Array, places: Int32Array) -> None:
    """Copy every column's ancestors to their places."""
    for row in range(source.shape[0]):
        old = source[row]
        new = target[row]
        for m in range(ancestors.size):
            new[np.uint32(places[m])] = old[np.uint32(ancestors[m])]
