"""The figures of histogram.md, drawn from the project's own code: python docs/figures.py histogram."""

from __future__ import annotations

import math
from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from filters.cells import CellIntegral, CellMean, Cells
from filters.grid import Axis, Columns, Grid, LogDensity, circle
from filters.histogram import HistogramFilter
from filters.kalman import KalmanFilter
from filters.regions import Partition, RegionGraph, TopologicalFilter
from service.textbook.style import BLUE, GREEN, GREY, ORANGE

NOISE, SENSOR = 0.5, 0.8
CONSTANT = -math.log(SENSOR * math.sqrt(2.0 * math.pi))


def reading(z: float) -> LogDensity:
    """Return the likelihood of a position measured directly."""
    return lambda states: CONSTANT - 0.5 * ((z - states[0]) / SENSOR) ** 2


def kalman_error(cells: int, rule: Cells) -> tuple[float, float]:
    """Error of the variance and of the log evidence against the Kalman filter, after ten steps."""
    belief = HistogramFilter(Grid([Axis(-16.0, 16.0, cells)]), rule)
    belief.initialize(lambda states: -0.5 * (states[0] + 3.0) ** 2)
    exact, evidence = KalmanFilter([-3.0], [[1.0]]), 0.0
    for z in np.random.default_rng(1).normal(size=10):
        belief.predict(lambda states: [0.9 * states[0] + 0.5], [NOISE])
        exact.predict([[0.9]], [[NOISE**2]], [[1.0]], [0.5])
        evidence += belief.update(reading(z)) - exact.correct([z], [[1.0]], [[SENSOR**2]]).log_evidence
    return abs(belief.moments().covariance[0, 0] - exact.covariance[0, 0]), abs(evidence)


def cells() -> Figure:
    """Mean states against integrals, by the size of the cells."""
    counts = np.array([16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512])
    width = 32.0 / counts / NOISE
    figure, axes = plt.subplots(1, 2, figsize=(7.6, 3.2), layout="constrained")
    rules = (
        (CellMean(), BLUE, "o", "mean states, eq. 4.4, 4.5"),
        (CellIntegral(4), ORANGE, "s", "integrals, eq. 4.6, 4.9"),
    )
    for rule, colour, marker, label in rules:
        errors = np.array([kalman_error(int(count), rule) for count in counts])
        for axis, error in zip(axes, errors.T, strict=True):
            axis.loglog(
                width, np.maximum(error, 1e-12), color=colour, marker=marker, markersize=4, label=label
            )
    axes[0].set_ylabel("error of the variance, m²")
    axes[1].set_ylabel("error of the log evidence, nat")
    for axis in axes:
        axis.axvline(1.0, color=GREY, linewidth=0.8, linestyle="--")
        axis.set_xlabel("width of a cell / sigma of the motion")
        axis.set_xticks([0.125, 0.25, 0.5, 1.0, 2.0, 4.0], ["1/8", "1/4", "1/2", "1", "2", "4"])
        axis.minorticks_off()
    axes[0].legend(loc="lower right")
    return figure


FIELD = Grid([Axis(-30.0, 30.0, 120), Axis(-30.0, 30.0, 120), circle(24)])
BEACONS = ((-20.0, -10.0), (18.0, -14.0), (2.0, 22.0))
SETTLED = 5
"""Steps until the start is forgotten."""

SHARES = (0.3, 0.1, 0.03, 0.01, 1e-3, 1e-4, 1e-6)


def to_beacon(distance: float, beacon: tuple[float, float]) -> LogDensity:
    """Return the likelihood of a range, sigma 1 m."""
    return lambda s: -0.5 * np.square(np.hypot(s[0] - beacon[0], s[1] - beacon[1]) - distance)


def drive(share: float) -> tuple[HistogramFilter, list[int]]:
    """Filter twenty ranges from an unknown start; return the last belief and the cells touched each step."""
    rng = np.random.default_rng(3)
    belief = HistogramFilter(FIELD, share=share)
    north, east, heading = -8.0, 4.0, 0.4
    touched: list[int] = []
    for step in range(20):
        beacon = BEACONS[step % 3]
        belief.update(
            to_beacon(math.hypot(north - beacon[0], east - beacon[1]) + rng.standard_normal(), beacon)
        )
        cost = belief.touched

        def forward(s: Columns) -> Sequence[np.ndarray]:
            return s[0] + np.cos(s[2]), s[1] + np.sin(s[2]), s[2] + 0.15

        belief.predict(forward, [0.3, 0.3, 0.1])
        touched.append(cost + belief.touched)
        north, east, heading = north + math.cos(heading), east + math.sin(heading), heading + 0.15
    return belief, touched


def selective() -> Figure:
    """Cost against error of selective updating."""
    exact, every = drive(0.0)
    figure, (left, right) = plt.subplots(1, 2, figsize=(7.8, 3.2), layout="constrained")
    colours = plt.get_cmap("viridis")(np.linspace(0.05, 0.85, len(SHARES)))
    costs, errors = [], []
    for share, colour in zip(SHARES, colours, strict=True):
        belief, touched = drive(share)
        costs.append(sum(touched[SETTLED:]) / sum(every[SETTLED:]))
        errors.append(0.5 * float(np.abs(belief.belief - exact.belief).sum()))
        print(f"share {share:g}: {costs[-1]:.5f} of the cells, total variation {errors[-1]:.2e}")
        if share in (0.1, 1e-3, 1e-6):
            relative = np.array(touched) / np.array(every)
            right.semilogy(
                np.arange(1, 21), relative, color=colour, marker="o", markersize=3, label=f"{share:g}"
            )
    left.loglog(costs, errors, color=GREY, linewidth=1, zorder=1)
    left.scatter(costs, errors, c=colours, s=28, zorder=2)
    for share, cost, error in zip(SHARES, costs, errors, strict=True):
        left.annotate(f"{share:g}", (cost, error), xytext=(6, 3), textcoords="offset points", fontsize=8)
    left.set_xlabel("cells moved and weighed, share of all, steps 6 to 20")
    left.set_ylabel("total variation from the full update")
    left.margins(x=0.18)
    percents = [0.002, 0.003, 0.005, 0.01]
    left.set_xticks(percents, [f"{100.0 * share:g} %" for share in percents])
    left.minorticks_off()
    right.set_xlabel("step")
    right.set_ylabel("cells moved and weighed, share of all")
    right.set_xticks([1, 5, 10, 15, 20])
    right.legend(title="threshold")
    return figure


def regions() -> Figure:
    """The same walk on a metric grid and on a graph of three regions."""
    grid = Grid([Axis(0.0, 30.0, 60), Axis(0.0, 4.0, 8)])
    labels = np.repeat([0, 1, 2], 20)
    partition = Partition(grid, np.broadcast_to(labels[:, None], grid.shape), ("west", "middle", "east"))
    metric = HistogramFilter(grid)
    metric.reset(partition.spread([1.0, 0.0, 0.0]))
    never = 1e9
    eastward = {
        ("west", "middle"): 20.0,
        ("middle", "west"): never,
        ("middle", "east"): 20.0,
        ("east", "middle"): never,
    }
    coarse = TopologicalFilter(RegionGraph(partition.regions, eastward), [1.0, 0.0, 0.0])
    rows = [np.concatenate([partition.masses(metric.belief), coarse.belief])]
    for _ in range(60):
        metric.predict(lambda s: [s[0] + 0.5, s[1]], [0.6, 0.3])
        coarse.predict(1.0)
        rows.append(np.concatenate([partition.masses(metric.belief), coarse.belief]))
    shares = np.array(rows)
    figure, axis = plt.subplots(figsize=(6.4, 3.0), layout="constrained")
    for k, (name, colour) in enumerate(zip(partition.regions, (BLUE, GREEN, ORANGE), strict=True)):
        axis.plot(shares[:, k], color=colour, label=name)
        axis.plot(shares[:, 3 + k], color=colour, linestyle="--")
    axis.set_xlabel("time, s")
    axis.set_ylabel("probability of the region")
    axis.legend(loc="center right", title="solid: grid, dashed: graph")
    return figure


FIGURES = {"cells": cells, "selective": selective, "regions": regions}
