"""Figure 4.2: a static grid and a density tree with equally many cells."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from filters.textbook import partition, transform
from filters.textbook.partition import Partition
from service.textbook.exhibit import Exhibit, Table, number
from service.textbook.style import BLUE, ORANGE, PALE, label, panels, sheet, steps


def decompositions() -> Exhibit:
    """Figure 4.2."""
    grid, tree, accuracy = partition.grid(), partition.tree(), partition.accuracy()
    figure = sheet(8.6, 6.0)
    static, dynamic, error, branches = panels(figure, 2, 2)
    _draw(static, grid, f"static: {grid.depths.size} cells", ORANGE)
    _draw(dynamic, tree, f"dynamic: a density tree with {tree.depths.size} leaves", BLUE)
    _branch(branches, tree)
    error.loglog(accuracy.grid_cells, accuracy.grid_errors, "o-", color=ORANGE, markersize=4, label="grid")
    error.loglog(accuracy.tree_cells, accuracy.tree_errors, "o-", color=BLUE, markersize=4, label="tree")
    label(error, "error", "cells", "half the integral of |difference|")
    error.legend()
    rows = [
        ("grid", str(cells), number(float(wrong), 3))
        for cells, wrong in zip(accuracy.grid_cells, accuracy.grid_errors, strict=True)
    ] + [
        ("tree", str(cells), number(float(wrong), 3))
        for cells, wrong in zip(accuracy.tree_cells, accuracy.tree_errors, strict=True)
    ]
    return Exhibit(
        (Table("probability in the wrong place", ("decomposition", "cells", "wrong"), rows),), figure
    )


def _draw(axis: Axes, part: Partition, title: str, colour: str) -> None:
    fine = np.linspace(*partition.SPAN, 501)
    axis.fill_between(fine, transform.density(fine), color=PALE, linewidth=0, label="exact")
    steps(axis, part.edges, part.probabilities / np.diff(part.edges), colour, "cells")
    axis.vlines(part.edges, -0.06, 0.0, color=colour, linewidth=0.8)
    label(axis, title, "y", "density")
    axis.set_ylim(-0.07, 0.9)
    axis.legend(loc="upper left")


def _branch(axis: Axes, part: Partition) -> None:
    """Draw the tree: every box from its depth down to its halves."""
    edges = set(part.edges.tolist())
    ahead = [(*partition.SPAN, 0)]
    while ahead:
        low, high, depth = ahead.pop()
        inside = [edge for edge in edges if low < edge < high]
        middle = 0.5 * (low + high)
        if not inside:
            axis.plot([middle], [depth], "s", color=BLUE, markersize=3)
            continue
        for first, last in ((low, middle), (middle, high)):
            child = 0.5 * (first + last)
            axis.plot([middle, child, child], [depth, depth, depth + 1], color=BLUE, linewidth=0.9)
            ahead.append((first, last, depth + 1))
    label(axis, "the tree, cut by cut", "y", "depth, cuts")
    axis.set_ylim(float(part.depths.max()) + 0.4, -0.4)
    axis.set_xlim(*partition.SPAN)
