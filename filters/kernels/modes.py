"""Modes of a particle set on a small grid: its smoothed density, and the hills that deep valleys part.

The hills are found by persistence (Chazal, Guibas, Oudot and Skraba, "Persistence-based clustering in Riemannian
manifolds", Journal of the ACM 60(6), 2013): cells are taken from the densest down; a cell without denser neighbours
starts a hill, one between two hills is their saddle, and the lower hill is part of the higher one unless the saddle
lies deep below its summit. However long, bent or ring-shaped a hill is, it stays one.
"""

from __future__ import annotations

import math

import numpy as np
from numpy import float64
from numpy.typing import NDArray

from filters.kernels.compile import Float32Array, Int32Array, function, kernel
from filters.kernels.elementary import sincos

Float64Array = NDArray[np.float64]
Int64Array = NDArray[np.int64]

NOTHING = 1e-9
"""A density that is none."""

FRAME = 8
"""Of the positions: mean north and east, three numbers of the lower triangular whitening. The effective sample size.

Then the largest variance of the positions in any direction (m²), and the length of the headings' mean vector."""


@kernel(
    "int64(float32[:, ::1], float32[::1], int32[::1], int64, float32[::1], float32[:, ::1], float32[::1])"
)
def gather(
    columns: Float32Array,
    weights: Float32Array,
    labels: Int32Array,
    count: int,
    factors: Float32Array,
    some: Float32Array,
    some_weights: Float32Array,
) -> int:
    """Take particles evenly spaced among those whose label has a factor, up to the room there is; return how many.

    A particle's weight is multiplied by its label's factor; those of a factor of zero are left out.
    """
    own = 0
    for i in range(count):
        own += factors[labels[i]] > 0.0
    stride = max(1, -(-own // some_weights.size))
    taken = seen = 0
    for i in range(count):
        factor = factors[labels[i]]
        if factor > 0.0:
            if seen % stride == 0:
                for j in range(some.shape[0]):
                    some[j, taken] = columns[j, i]
                some_weights[taken] = weights[i] * factor
                taken += 1
            seen += 1
    return taken


@kernel("void(float32[:, ::1], float32[::1], int64, float64, float64[::1])", exact=True)
def survey(some: Float32Array, weights: Float32Array, count: int, least: float, frame: Float64Array) -> None:
    """Write the frame in which the positions have unit covariance; ``least`` is added to their variances (m²)."""
    total = squares = n = e = nn = ne = ee = across_all = along_all = 0.0
    north, east = float64(some[0, 0]), float64(some[1, 0])
    for i in range(count):
        w = float64(weights[i])
        dn, de = float64(some[0, i]) - north, float64(some[1, i]) - east
        total += w
        squares += w * w
        n += w * dn
        e += w * de
        nn += w * dn * dn
        ne += w * dn * de
        ee += w * de * de
        sine, cosine = sincos(some[2, i])
        across_all += w * sine
        along_all += w * cosine
    if not total > 0.0:
        frame[5] = 0.0
        return
    n, e = n / total, e / total
    nn, ne, ee = nn / total - n * n, ne / total - n * e, ee / total - e * e
    frame[6] = 0.5 * (nn + ee) + math.sqrt(0.25 * (nn - ee) ** 2 + ne * ne)
    frame[7] = math.sqrt(across_all * across_all + along_all * along_all) / total
    nn, ee = nn + least, ee + least
    root = math.sqrt(nn)
    across = ne / root
    rest = math.sqrt(max(ee - across * across, 1e-12 * ee))
    frame[0] = north + n
    frame[1] = east + e
    frame[2] = 1.0 / root
    frame[3] = -across / (root * rest)
    frame[4] = 1.0 / rest
    frame[5] = total * total / squares


@function
def place(north: float, east: float, frame: Float64Array, side: int, cell: float) -> tuple[float, float]:
    """Row and column, not rounded, of a position on a square grid about the frame's mean."""
    dn, de = float64(north) - frame[0], float64(east) - frame[1]
    middle = 0.5 * (side - 1)
    return frame[2] * dn / cell + middle, (frame[3] * dn + frame[4] * de) / cell + middle


@kernel("void(float32[:, ::1], float32[::1], int64, float64[::1], float64, float64[:, ::1])", exact=True)
def spread(
    some: Float32Array,
    weights: Float32Array,
    count: int,
    frame: Float64Array,
    cell: float,
    grid: Float64Array,
) -> None:
    """Divide each weight among the four cells about its position, in units that sum to the effective sample size.

    What lies outside counts at the edge.
    """
    side = grid.shape[0]
    total = 0.0
    for i in range(count):
        total += float64(weights[i])
    for row in range(side):
        for column in range(side):
            grid[row, column] = 0.0
    for i in range(count):
        y, x = place(some[0, i], some[1, i], frame, side, cell)
        y, x = min(max(y, 1.0), side - 2.001), min(max(x, 1.0), side - 2.001)
        row, column = int(y), int(x)
        down, right = y - row, x - column
        w = float64(weights[i]) * frame[5] / total
        grid[row, column] += w * (1.0 - down) * (1.0 - right)
        grid[row, column + 1] += w * (1.0 - down) * right
        grid[row + 1, column] += w * down * (1.0 - right)
        grid[row + 1, column + 1] += w * down * right


@kernel("void(float32[::1], float32[::1], int64, float64, float64[:, ::1])", exact=True)
def spread_angles(
    angles: Float32Array, weights: Float32Array, count: int, size: float, grid: Float64Array
) -> None:
    """The same for angles on a grid of one row that is a whole circle; the weights come to ``size`` in all."""
    bins = grid.shape[1]
    total = 0.0
    for i in range(count):
        total += float64(weights[i])
    for column in range(bins):
        grid[0, column] = 0.0
    for i in range(count):
        x = (float64(angles[i]) / (2.0 * math.pi) + 1.0) * bins
        column = int(x)
        right = x - column
        w = float64(weights[i]) * size / total
        grid[0, column % bins] += w * (1.0 - right)
        grid[0, (column + 1) % bins] += w * right


@kernel("void(float64[:, ::1], float64[:, ::1], int64, boolean)", exact=True)
def smooth(grid: Float64Array, spare: Float64Array, passes: int, around: bool) -> None:
    """Convolve with (1, 2, 1) / 4 along each side, ``passes`` times; columns wrap where they go ``around``."""
    rows, columns = grid.shape
    for _ in range(passes):
        for row in range(rows):
            for column in range(columns):
                before, after = column - 1, column + 1
                if around:
                    before, after = before % columns, after % columns
                left = grid[row, before] if before >= 0 else 0.0
                right = grid[row, after] if after < columns else 0.0
                spare[row, column] = 0.25 * (left + right) + 0.5 * grid[row, column]
        for row in range(rows):
            for column in range(columns):
                if rows == 1:
                    grid[row, column] = spare[row, column]
                    continue
                above = spare[row - 1, column] if row > 0 else 0.0
                below = spare[row + 1, column] if row < rows - 1 else 0.0
                grid[row, column] = 0.25 * (above + below) + 0.5 * spare[row, column]


@function
def root_of(parents: Int32Array, cell: int) -> int:
    """The cell that stands for the hill which ``cell`` is part of."""
    while parents[cell] != cell:
        cell = parents[cell]
    return cell


@kernel("int64(float64[::1], int64[::1])", exact=True)
def descending(values: Float64Array, order: Int64Array) -> int:
    """Sort the indices of what is there by falling value, by Shell's method; return how many there are.

    Equal values have no order of their own, but always the same.
    """
    size = 0
    for i in range(values.size):
        if values[i] > NOTHING:
            order[size] = i
            size += 1
    gap = 1
    while gap < size // 3:
        gap = 3 * gap + 1
    while gap > 0:
        for i in range(gap, size):
            moving = order[i]
            j = i
            while j >= gap and values[order[j - gap]] < values[moving]:
                order[j] = order[j - gap]
                j -= gap
            order[j] = moving
        gap //= 3
    return size


@kernel(
    "void(float64[:, ::1], int64[::1], boolean, float64, float64, float64, int32[::1])",
    exact=True,
)
def hills(  # noqa: C901  one pass over the cells, with the neighbours of each
    grid: Float64Array,
    order: Int64Array,
    around: bool,
    ratio: float,
    significance: float,
    worth: float,
    parents: Int32Array,
) -> None:
    """Write for each cell the summit of the hill it belongs to; -1 where nothing is.

    Two hills stay two if their saddle lies below ``ratio`` of the lower summit, and the difference of the roots of the
    counts at both, whose deviation is 1/2 each whatever the count, is ``significance`` deviations. A density of one is
    worth as much as ``worth`` independent particles.
    """
    rows, columns = grid.shape
    values = grid.reshape(grid.size)
    for cell in range(values.size):
        parents[cell] = -1
    for index in range(order.size):
        cell = order[index]
        value = values[cell]
        row, column = cell // columns, cell % columns
        best = -1
        for pass_ in range(2):  # first find the highest hill it touches, then let the others join it
            for down in range(-1, 2):
                for right in range(-1, 2):
                    beside, across = row + down, column + right
                    if around:
                        across %= columns
                    if not (0 <= beside < rows and 0 <= across < columns):
                        continue
                    neighbour = beside * columns + across
                    if parents[neighbour] < 0 or neighbour == cell:
                        continue
                    top = root_of(parents, neighbour)
                    if pass_ == 0:
                        if best < 0 or values[top] > values[best]:
                            best = top
                    elif top != best:
                        peak = values[top]
                        gap = math.sqrt(peak * worth) - math.sqrt(value * worth)
                        if value > ratio * peak or gap < significance * math.sqrt(0.5):
                            parents[top] = best
            if best < 0:
                parents[cell] = cell
                break
            parents[cell] = best


@kernel("int64(float64[:, ::1], boolean, float64, int32[::1], int32[::1], float64[::1])", exact=True)
def regions(  # noqa: C901  the passes of one flood
    grid: Float64Array,
    around: bool,
    least: float,
    parents: Int32Array,
    numbers: Int32Array,
    masses: Float64Array,
) -> int:
    """Number the hills that hold at least ``least`` of the mass, and give every other cell to a neighbour's hill.

    Writes the number of each cell's hill and the mass of each hill as it was found; returns how many there are. As
    many as there is room for in ``masses``, which come first in the order of their summits' cells.
    """
    rows, columns = grid.shape
    values = grid.reshape(grid.size)
    total = 0.0
    mass = np.zeros(values.size)
    for cell in range(values.size):
        if parents[cell] >= 0:
            mass[root_of(parents, cell)] += values[cell]
            total += values[cell]
    found = 0
    for cell in range(values.size):
        numbers[cell] = -1
        if parents[cell] == cell and mass[cell] >= least * total and found < masses.size:
            numbers[cell] = found
            masses[found] = mass[cell] / total
            found += 1
    for cell in range(values.size):
        if parents[cell] >= 0:
            numbers[cell] = numbers[root_of(parents, cell)]
    if found < 2:
        for cell in range(values.size):
            numbers[cell] = 0
        return found
    open_cells = True
    while open_cells:
        open_cells = False
        for cell in range(values.size):
            if numbers[cell] >= 0:
                continue
            row, column = cell // columns, cell % columns
            near = -1
            for down in range(-1, 2):
                for right in range(-1, 2):
                    beside, across = row + down, column + right
                    if around:
                        across %= columns
                    if 0 <= beside < rows and 0 <= across < columns:
                        other = numbers[beside * columns + across]
                        if 0 <= other < found:
                            near = other
            if near >= 0:
                numbers[cell] = near + found  # not before the next round, or one side would win
            open_cells = True
        for cell in range(values.size):
            if numbers[cell] >= found:
                numbers[cell] -= found
    return found


@kernel(
    "void(float32[:, ::1], int32[::1], int64, int32, float64[::1], float64, int64, int32[::1], int32[::1])"
)
def relabel(
    columns: Float32Array,
    labels: Int32Array,
    count: int,
    old: int,
    frame: Float64Array,
    cell: float,
    side: int,
    numbers: Int32Array,
    names: Int32Array,
) -> None:
    """Give the particles of one label the labels of the hills on whose cells they lie; outside, of the nearest cell."""
    for i in range(count):
        if labels[i] == old:
            y, x = place(columns[0, i], columns[1, i], frame, side, cell)
            row = int(min(max(y + 0.5, 0.0), side - 1.0))
            column = int(min(max(x + 0.5, 0.0), side - 1.0))
            labels[i] = names[numbers[row * side + column]]


@kernel("void(float32[:, ::1], int32[::1], int64, int32, int32[::1], int32[::1])")
def relabel_angles(
    columns: Float32Array,
    labels: Int32Array,
    count: int,
    old: int,
    numbers: Int32Array,
    names: Int32Array,
) -> None:
    """The same by heading, the third column."""
    bins = numbers.size
    for i in range(count):
        if labels[i] == old:
            x = (float64(columns[2, i]) / (2.0 * math.pi) + 1.0) * bins
            labels[i] = names[numbers[int(x + 0.5) % bins]]
