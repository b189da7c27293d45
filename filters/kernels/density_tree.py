"""Growing a density tree around moved boxes of probability, and finding the leaf that a point lies in."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from filters.kernels.compile import function, kernel

Float64Array = NDArray[np.float64]
Int64Array = NDArray[np.int64]

TAIL = 6.0
_ROOT_HALF = math.sqrt(0.5)
_ROOT_TWO_PI = math.sqrt(2.0 * math.pi)
_NOTHING = 1e-8


@kernel(
    "void(float64[:, ::1], int64[::1], float64[::1], int64[::1], int64[::1])",
    exact=True,
)
def find(
    points: Float64Array, axis: Int64Array, cut: Float64Array, child: Int64Array, leaf: Int64Array
) -> None:
    """Descend from the root for every point; ``leaf`` holds -1 for those that are to be left out."""
    for i in range(points.shape[0]):
        if leaf[i] < 0:
            continue
        node = 0
        while axis[node] >= 0:
            along = axis[node]
            node = child[node] + (1 if points[i, along] >= cut[node] else 0)
        leaf[i] = node


@function
def _integral(x: float, sigma: float) -> float:
    """Integral of the Gaussian's cumulative probability up to x."""
    if sigma <= 0.0:
        return max(x, 0.0)
    u = x / sigma
    if u > TAIL:
        return x
    if u < -TAIL:
        return 0.0
    return x * 0.5 * math.erfc(-u * _ROOT_HALF) + sigma * math.exp(-0.5 * u * u) / _ROOT_TWO_PI


@function
def _below(x: float, half: float, sigma: float) -> float:
    """Probability that a uniform number within ``half`` of 0, plus Gaussian noise, lies below x."""
    reach = half + TAIL * sigma
    if x >= reach:
        return 1.0
    if x <= -reach:
        return 0.0
    return (_integral(x + half, sigma) - _integral(x - half, sigma)) / (2.0 * half)


@function
def _cumulative(x: float, mean: float, half: float, sigma: float, period: float) -> float:
    """Cumulative probability at x, summed over all turns of an axis that wraps (a period of 0: it does not).

    Of the turns, those that lie wholly below x in all that is asked count as one each; only differences mean
    something then.
    """
    if period == 0.0:
        return _below(x - mean, half, sigma)
    turns = math.ceil((half + TAIL * sigma) / period) + 1
    total = 0.0
    for turn in range(-turns, turns + 1):
        total += _below(x - mean - turn * period, half, sigma)
    return total


@function
def _axis_to_cut(
    low: Float64Array, high: Float64Array, finest: Float64Array, coarsest: Float64Array, heavy: int
) -> int:
    """Return the axis along which a box is cut, -1 for none; see :func:`filters.tree_nodes.axes_to_cut`."""
    chosen, largest = -1, 1.0 + 1e-9
    for k in range(low.size):
        excess = (high[k] - low[k]) / coarsest[k]
        if excess > largest:
            chosen, largest = k, excess
    if chosen < 0 and heavy == 1:
        largest = 2.0 * (1.0 - 1e-9)
        for k in range(low.size):
            excess = (high[k] - low[k]) / finest[k]
            if excess > largest:
                chosen, largest = k, excess
    return chosen


@function
def _reach(
    masses: Float64Array,
    means: Float64Array,
    halves: Float64Array,
    sigma: Float64Array,
    periods: Float64Array,
    low: Float64Array,
    high: Float64Array,
    mass: Float64Array,
    source: Int64Array,
    lower: Float64Array,
    upper: Float64Array,
) -> int:
    """Note which sources reach the root, and sum their probability in it; return how many they are."""
    used = 0
    total = 0.0
    for i in range(masses.size):
        p = masses[i]
        for k in range(low.shape[1]):
            lower[used, k] = _cumulative(low[0, k], means[i, k], halves[i, k], sigma[k], periods[k])
            upper[used, k] = _cumulative(high[0, k], means[i, k], halves[i, k], sigma[k], periods[k])
            p *= upper[used, k] - lower[used, k]
        if p > 0.0:
            source[used] = i
            used += 1
            total += p
    mass[0] = total
    return used


@function
def _half(
    entry: int,
    top: int,
    along: int,
    side: int,
    masses: Float64Array,
    source: Int64Array,
    lower: Float64Array,
    upper: Float64Array,
    middles: Float64Array,
) -> float:
    """Copy an entry of the arena to its top, for one half of the box; return its probability, 0 if none."""
    i = source[entry]
    mass = float(masses[i])
    share = 1.0
    for k in range(lower.shape[1]):
        lower[top, k] = lower[entry, k]
        upper[top, k] = upper[entry, k]
        if k == along and side == 0:
            upper[top, k] = middles[entry]
        if k == along and side == 1:
            lower[top, k] = middles[entry]
        share *= float(upper[top, k] - lower[top, k])
    source[top] = i
    return mass * share if share > _NOTHING else 0.0


@kernel(
    "int64(float64[::1], float64[:, ::1], float64[:, ::1], float64[::1], float64[::1], float64[::1],"
    "float64[::1], float64, float64[:, ::1], float64[:, ::1], int64[::1], int64[::1], float64[::1],"
    "int64[:, ::1], int64[::1], float64[:, ::1], float64[:, ::1], float64[::1])",
    exact=True,
)
def grow(
    masses: Float64Array,
    means: Float64Array,
    halves: Float64Array,
    sigma: Float64Array,
    periods: Float64Array,
    finest: Float64Array,
    coarsest: Float64Array,
    bound: float,
    low: Float64Array,
    high: Float64Array,
    axis: Int64Array,
    child: Int64Array,
    mass: Float64Array,
    stack: Int64Array,
    source: Int64Array,
    lower: Float64Array,
    upper: Float64Array,
    middles: Float64Array,
) -> int:
    """Grow the tree of a sum of boxes, each uniform with half widths ``halves`` and blurred by ``sigma``.

    ``low[0]`` and ``high[0]`` are the root's. The probability of any box is exact, so every box whose share
    of the whole exceeds ``bound`` is cut. Depth first, with the sources that reach a box, and their
    cumulative probabilities at its ends along each axis, in an arena (``source``, ``lower``, ``upper``,
    ``middles``) that grows and shrinks like the ``stack``: a cut costs one new number for each source.
    Returns how many nodes there are; -1 if they do not fit, -2 if the arena or the stack is too small.
    """
    used = _reach(masses, means, halves, sigma, periods, low, high, mass, source, lower, upper)
    total = mass[0]
    nodes = 1
    axis[0] = -1
    stack[0, 0], stack[0, 1], stack[0, 2] = 0, 0, used
    depth = 1
    while depth > 0:
        depth -= 1
        node, first, end = stack[depth, 0], stack[depth, 1], stack[depth, 2]
        heavy = 1 if mass[node] > bound * total else 0
        along = _axis_to_cut(low[node], high[node], finest, coarsest, heavy)
        if along < 0:
            continue
        if nodes + 2 > axis.size:
            return -1
        if end + 2 * (end - first) + 1 > source.size or depth + 2 > stack.shape[0]:
            return -2
        axis[node] = along
        child[node] = nodes
        middle = 0.5 * (low[node, along] + high[node, along])
        for entry in range(first, end):
            i = source[entry]
            middles[entry] = _cumulative(
                middle, means[i, along], halves[i, along], sigma[along], periods[along]
            )
        top = end
        for side in range(2):
            new = nodes + side
            axis[new] = -1
            low[new] = low[node]
            high[new] = high[node]
            if side == 0:
                high[new, along] = middle
            else:
                low[new, along] = middle
            stack[depth, 0], stack[depth, 1] = new, top
            mass[new] = 0.0
            for entry in range(first, end):
                p = _half(entry, top, along, side, masses, source, lower, upper, middles)
                if p > 0.0:
                    mass[new] += p
                    top += 1
            stack[depth, 2] = top
            depth += 1
        nodes += 2
    return nodes
