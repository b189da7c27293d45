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


@kernel("int64(float32[::1], int64, int64, float64, float64, float64, int64, int64, int32[::1])", exact=True)
def systematic_part(
    weights: Float32Array,
    first: int,
    last: int,
    before: float,
    scale: float,
    uniform: float,
    start: int,
    stop: int,
    ancestors: Int32Array,
) -> int:
    """Let the sources ``first`` to ``last`` write themselves to the places ``start`` to ``stop``, and nowhere else.

    ``before`` is the cumulative weight of the sources before them, and ``scale`` the draws per weight.
    """
    shift = 1.0 - uniform
    cumulative = before
    i = int64(first)
    while i < last and start <= stop - _AHEAD:
        cumulative += float64(weights[uint64(i)])
        end = min(stop, int(cumulative * scale + shift))
        for k in range(_AHEAD):
            ancestors[uint64(start + k)] = i
        for m in range(start + _AHEAD, end):
            ancestors[uint64(m)] = i
        start = end
        i += 1
    while i < last and start < stop:
        cumulative += float64(weights[uint64(i)])
        end = min(stop, int(cumulative * scale + shift))
        for m in range(start, end):
            ancestors[m] = i
        start = end
        i += 1
    if start < stop:
        i = last - 1
        while i > 0 and weights[i] <= 0.0:
            i -= 1
        for m in range(start, stop):
            ancestors[m] = i
    return stop


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
    systematic_part(weights, 0, weights.size, 0.0, count / total, uniform, 0, count, ancestors)


@kernel("void(float32[::1], int64[::1], int64, int64, float64[::1])")
def totals(
    weights: Float32Array,
    bounds: NDArray[np.int64],
    first_block: int,
    last_block: int,
    out: NDArray[np.float64],
) -> None:
    """The :func:`total` of each of some blocks; block b lies from ``bounds[b]`` to ``bounds[b + 1]``."""
    for block in range(first_block, last_block):
        out[block] = total(weights[bounds[block] : bounds[block + 1]])


@kernel("void(float32[::1], int64[::1], int64, int64, float64[::1], float64, int32[::1])", exact=True)
def systematic_blocks(
    weights: Float32Array,
    bounds: NDArray[np.int64],
    first_block: int,
    last_block: int,
    masses: NDArray[np.float64],
    uniform: float,
    ancestors: Int32Array,
) -> None:
    """:func:`systematic` by blocks of sources, whose :func:`totals` say which places are theirs: in any order."""
    count = ancestors.size
    blocks = bounds.size - 1
    whole = 0.0
    for block in range(blocks):
        whole += masses[block]
    scale = count / whole
    before = 0.0
    start = 0
    for block in range(last_block):
        after = before + masses[block]
        stop = count if block == blocks - 1 else min(count, int(after * scale + (1.0 - uniform)))
        if block >= first_block:
            systematic_part(
                weights, bounds[block], bounds[block + 1], before, scale, uniform, start, stop, ancestors
            )
        before = after
        start = stop


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


@kernel("void(float32[::1], float32[::1], int64, int64)")
def level(weights: Float32Array, log_weights: Float32Array, first: int, last: int) -> None:
    """Make some particles weigh the same."""
    for i in range(first, last):
        weights[i] = float32(1.0)
        log_weights[i] = float32(0.0)


@kernel(
    "void(float32[:, ::1], float32[:, ::1], float32[::1], float32[::1], int64[::1], float64[::1], int32[::1],"
    "int64[::1], float64)",
    exact=True,
)
def redraw(
    source: Float32Array,
    target: Float32Array,
    weights: Float32Array,
    log_weights: Float32Array,
    sources: NDArray[np.int64],
    masses: NDArray[np.float64],
    ancestors: Int32Array,
    bounds: NDArray[np.int64],
    uniform: float,
) -> None:
    """All of it in one call, for one thread: draw from the blocks ``sources``, deal to ``bounds``, level the weights.

    ``masses`` has room for the blocks' :func:`totals`.
    """
    blocks = sources.size - 1
    totals(weights, sources, 0, blocks, masses)
    systematic_blocks(weights, sources, 0, blocks, masses, uniform, ancestors)
    deal(source, target, ancestors, bounds, 0, (ancestors.size + RUN - 1) // RUN)
    level(weights, log_weights, 0, ancestors.size)


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
