"""The figures of density-tree.md, drawn from the project's own code: python docs/figures.py density_tree."""

from __future__ import annotations

import math

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from filters.cells import CellIntegral
from filters.density_tree import DensityTree, DensityTreeFilter, Side
from filters.grid import Axis, Grid, LogDensity
from filters.histogram import HistogramFilter
from service.textbook.style import BLUE, GREY, ORANGE, RED

HALF = 40.0
SIDES = [Side(-HALF, HALF, 0.02, 2.5)] * 2


def to_beacon(distance: float, north: float, east: float) -> LogDensity:
    """Return the likelihood of a range, sigma 0.4 m."""
    return lambda s: -0.5 * np.square((np.hypot(s[0] - north, s[1] - east) - distance) / 0.4)


READINGS = (to_beacon(14.0, 5.0, -4.0), to_beacon(18.0, -12.0, 10.0))


def tree_of(bound: float) -> DensityTreeFilter:
    """Return the belief after two ranges, as a tree."""
    belief = DensityTreeFilter(SIDES, bound)
    for reading in READINGS:
        belief.update(reading)
    return belief


def grid_of(cells: int) -> HistogramFilter:
    """Return the belief after two ranges, on a grid, by the same integrals as the tree."""
    belief = HistogramFilter(Grid([Axis(-HALF, HALF, cells)] * 2), CellIntegral(2))
    for reading in READINGS:
        belief.update(reading)
    return belief


def leaves() -> Figure:
    """The leaves after one range and after two, and close by."""
    belief = DensityTreeFilter(SIDES, 1 / 500)
    belief.update(READINGS[0])
    one = belief.tree
    belief.update(READINGS[1])
    figure, axes = plt.subplots(1, 3, figsize=(8.8, 3.1), layout="constrained")
    low, _, mass = belief.tree.leaf_boxes
    north, east = low[int(mass.argmax())]
    panels = (
        (one, (0.0, 0.0, HALF), f"one range: {one.leaf_count} leaves"),
        (belief.tree, (0.0, 0.0, HALF), f"two ranges: {belief.tree.leaf_count} leaves"),
        (belief.tree, (float(north), float(east), 3.5), "two ranges, closer"),
    )
    for axis, (tree, (middle_north, middle_east, half), title) in zip(axes, panels, strict=True):
        low, high, mass = tree.leaf_boxes
        size = high - low
        density = mass / size.prod(axis=1)
        boxes = PatchCollection(
            [Rectangle((a[1], a[0]), w[1], w[0]) for a, w in zip(low, size, strict=True)],
            cmap="Blues",
            edgecolor="#99999988",
            linewidth=0.3,
        )
        boxes.set_array(np.sqrt(density / density.max()))
        boxes.set_rasterized(True)  # thousands of outlines
        axis.add_collection(boxes)
        axis.grid(visible=False)
        axis.set_aspect("equal")
        axis.set_xlim(middle_east - half, middle_east + half)
        axis.set_ylim(middle_north - half, middle_north + half)
        axis.set_title(title, fontsize=9)
        axis.set_xlabel("east, m")
    axes[0].set_ylabel("north, m")
    return figure


def equal_error() -> Figure:
    """Total variation from the posterior itself, by the number of cells: tree and static grid."""
    fine = Grid([Axis(-HALF, HALF, 2048)] * 2)
    reference = HistogramFilter(fine)
    for reading in READINGS:
        reference.update(reading)
    states = np.column_stack(fine.states_at(np.arange(fine.size)))
    exact = reference.belief.reshape(-1) / fine.volume

    def errors(density: np.ndarray) -> tuple[float, float]:
        seen = exact > 1e-12
        divergence = exact[seen] @ np.log(exact[seen] / np.maximum(density[seen], 1e-300)) * fine.volume
        return 0.5 * float(np.abs(density - exact).sum()) * fine.volume, float(divergence)

    grid_cells = np.array([48, 64, 96, 128, 192, 256, 384, 512, 768])
    grids = np.array([errors(grid_of(int(n)).evaluate(states)) for n in grid_cells])
    trees = [tree_of(1.0 / n).tree for n in (30, 60, 120, 250, 500, 1000, 2000, 4000, 8000)]
    leaf_counts = np.array([tree.leaf_count for tree in trees])
    tree_errors = np.array([errors(tree.evaluate(states)) for tree in trees])
    for column, name in enumerate(("total variation", "Kullback-Leibler")):
        needed = np.exp(
            np.interp(
                -np.log(tree_errors[:, column]),
                -np.log(grids[:, column]),
                2.0 * np.log(grid_cells),
                math.nan,
                math.nan,
            )
        )
        for count, error, cells in zip(leaf_counts, tree_errors[:, column], needed, strict=True):
            print(f"{name} {error:.4f}: {count} leaves, {cells:.0f} cells, {cells / count:.1f} times as many")
    figure, axes = plt.subplots(1, 2, figsize=(7.8, 3.2), layout="constrained")
    labels = ("total variation", "Kullback-Leibler distance, nat")
    for column, (axis, label) in enumerate(zip(axes, labels, strict=True)):
        axis.loglog(
            grid_cells**2, grids[:, column], color=ORANGE, marker="s", markersize=4, label="static grid"
        )
        axis.loglog(
            leaf_counts, tree_errors[:, column], color=BLUE, marker="o", markersize=4, label="density tree"
        )
        axis.set_xlabel("cells or leaves")
        axis.set_ylabel(label)
    axes[0].set_yticks([0.05, 0.1, 0.2, 0.5], ["0.05", "0.1", "0.2", "0.5"])
    axes[0].minorticks_off()
    axes[0].legend(loc="upper right")
    return figure


def lookup() -> Figure:
    """Steps from the root to a point's leaf, by the number of leaves."""
    rng = np.random.default_rng(5)
    points = np.column_stack([rng.normal(5.0, 2.0, 200_000), rng.normal(-8.0, 4.0, 200_000)])
    sides = [Side(-HALF, HALF, 1e-3)] * 2
    counts, mean, deepest = [], [], []
    for bound in (0.1, 0.03, 0.01, 3e-3, 1e-3, 3e-4, 1e-4):
        tree = DensityTree.of_particles(sides, points, bound)
        low, high, mass = tree.leaf_boxes
        counts.append(tree.leaf_count)
        mean.append(float(mass @ np.log2((2.0 * HALF) ** 2 / (high - low).prod(axis=1))))
        deepest.append(tree.depth)
    figure, axis = plt.subplots(figsize=(5.4, 3.1), layout="constrained")
    axis.semilogx(counts, deepest, color=GREY, marker="^", markersize=4, label="deepest leaf")
    axis.semilogx(counts, mean, color=BLUE, marker="o", markersize=4, label="mean over the belief")
    axis.semilogx(counts, np.log2(counts), color=RED, linewidth=1, linestyle="--", label="log₂ of the leaves")
    axis.set_xlabel("leaves")
    axis.set_ylabel("steps to a point's leaf")
    axis.set_ylim(0, None)
    axis.legend(loc="lower right")
    return figure


FIGURES = {"leaves": leaves, "error": equal_error, "lookup": lookup}
STYLE = {"savefig.dpi": 150}
