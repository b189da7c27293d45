"""Systematic resampling: where the copies come from, and where they are laid."""

from __future__ import annotations

import numpy as np
from numpy import float32, float64, int64, uint32, uint64
from numpy.typing import NDArray

from filters.kernels.compile import Float32Array, Int32Array, kernel

RUN = 16
"""Copies that are laid side by side before the next block has its turn: a cache line of float32."""

_AHEAD = 8
"""Places that a source writes at once, whether or not all are its own: the next source corrects it."""


@kernel("float64(float32[::1])")
def total(weights: Float32Array) -> float:
    """Sum of the weights in float64."""
    s = np.float64(0.0)
    for i in range(weights.size):
        s += np.float64(weights[i])
    return s


@kernel("void(float32[::1], float64, float64, int32[::1])", exact=True)
def systematic(weights: Float32Array, total: float, uniform: float, ancestors: Int32Array) -> None:
    """Table 4.4, with the loops the other way round: each source writes itself where its copies go.

    Source i takes the positions m with c(i-1) < (uniform + m) / count <= c(i), c being the cumulative weight;
    so the first position after it is floor(c · count - uniform) + 1. How many copies a source has cannot be
    predicted, so each writes eight, which is one instruction, and its successor overwrites what is too much; only a
    source with more copies takes a branch. What rounding leaves between the last cumulative weight and the total
    goes to the last source that has weight.
    """
    count = ancestors.size
    scale = count / total
    shift = 1.0 - uniform
    cumulative = 0.0
    start = int64(0)
    i = int64(0)
    while i < weights.size and start <= count - _AHEAD:
        cumulative += float64(weights[uint64(i)])
        end = min(count, int64(cumulative * scale + shift))
        for k in range(_AHEAD):
            ancestors[uint64(start + k)] = i
        for m in range(start + _AHEAD, end):
            ancestors[uint64(m)] = i
        start = end
        i += 1
    while i < weights.size and start < count:
        cumulative += float64(weights[uint64(i)])
        end = min(count, int64(cumulative * scale + shift))
        for m in range(start, end):
            ancestors[m] = i
        start = end
        i += 1
    if start < count:
        i = weights.size - 1
        while weights[i] <= 0.0:
            i -= 1
        for m in range(start, count):
            ancestors[m] = i


@kernel("void(float32[:, ::1], float32[:, ::1], int32[::1], int64[::1], int64, int64)", exact=True)
def deal(
    source: Float32Array,
    target: Float32Array,
    ancestors: Int32Array,
    bounds: NDArray[np.int64],
    first_run: int,
    last_run: int,
) -> None:
    """Copy ancestors to their places: runs of copies are dealt to the blocks in turn, like cards.

    Ancestors ascend; laid down in a row, the first block would hold only the first ancestors' copies. So each block
    gets a fair sample. Only the last run of all may be shorter than the others.
    """
    blocks = bounds.size - 1
    for row in range(source.shape[0]):
        old = source[row]
        new = target[row]
        block = first_run % blocks
        position = first_run // blocks * RUN
        for run in range(first_run, last_run):
            first = run * RUN
            place = bounds[uint64(block)] + position
            if first + RUN <= ancestors.size:
                for k in range(RUN):
                    new[uint64(place + k)] = old[uint32(ancestors[uint64(first + k)])]
            else:
                for k in range(ancestors.size - first):
                    new[uint64(place + k)] = old[uint32(ancestors[uint64(first + k)])]
            block += 1
            if block == blocks:
                block = 0
                position += RUN


@kernel(
    "void(float32[:, ::1], float32[:, ::1], float32[::1], float32[::1], int64, float64, int32[::1], int64[::1],"
    "float64)",
    exact=True,
)
def redraw(
    source: Float32Array,
    target: Float32Array,
    weights: Float32Array,
    log_weights: Float32Array,
    count: int,
    whole: float,
    ancestors: Int32Array,
    bounds: NDArray[np.int64],
    uniform: float,
) -> None:
    """All of it in one call, for one thread: draw from ``count`` sources, deal the copies, make them weigh the same.

    ``whole`` is the sources' :func:`total`, which the compiler might sum in another order in here.
    """
    systematic(weights[:count], whole, uniform, ancestors)
    deal(source, target, ancestors, bounds, 0, (ancestors.size + RUN - 1) // RUN)
    for i in range(ancestors.size):
        weights[i] = float32(1.0)
        log_weights[i] = float32(0.0)


def block_sizes(count: int, largest: int) -> list[int]:
    """Sizes of as few blocks as possible, none larger than ``largest`` by a run or more, all of nearly one size.

    Their number is one or even, so that two threads have as many each. ``deal`` gives run r to block r modulo the
    number of blocks, so the sizes follow from it.
    """
    number = -(-count // largest)
    if number > 1:
        number += number % 2
    runs, rest = divmod(-(-count // RUN), number)
    sizes = [RUN * (runs + (block < rest)) for block in range(number)]
    sizes[rest - 1] -= -count % RUN  # the last run of all may be short
    return sizes
