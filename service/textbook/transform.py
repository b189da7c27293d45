"""Figures 4.1, 4.3, 4.5 and 4.6: the standard example, a Gaussian through a nonlinear function."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from filters.textbook import extraction, histogram, normal, particles, transform
from service.textbook.exhibit import Exhibit, Table, number
from service.textbook.style import BLUE, GREEN, GREY, ORANGE, PALE, RED, label, panels, rug, sheet, steps

_SPAN = (-1.0, 3.0)
_FINE = np.linspace(*_SPAN, 301)


def cells() -> Exhibit:
    """Figure 4.1."""
    figure, image, source, error = _frame()
    found = histogram.histogram()
    widths = np.diff(found.edges)
    steps(source, found.edges, found.before / widths, BLUE, f"{widths.size} cells")
    heights = found.after / widths
    image.stairs(heights, found.edges, orientation="horizontal", fill=True, color=BLUE, alpha=0.3)
    image.stairs(heights, found.edges, orientation="horizontal", color=BLUE, label=f"{widths.size} cells")
    image.legend(loc="lower right")
    source.legend(loc="upper right")
    accuracies = [histogram.accuracy(points) for points in (1, 2, 8, 32)]
    for accuracy, colour in zip(accuracies, (ORANGE, GREEN, GREY, BLUE), strict=True):
        name = "1 point" if accuracy.points == 1 else f"{accuracy.points} points"
        error.loglog(accuracy.counts, accuracy.density_errors, "o-", color=colour, markersize=4, label=name)
    label(error, "error, by points passed per cell", "cells", "half the integral of |difference|")
    error.legend(loc="lower left")
    rows = [
        (str(accuracy.points), str(count), number(float(share), 3), number(float(density), 3))
        for accuracy in accuracies
        for count, share, density in zip(
            accuracy.counts, accuracy.cell_errors, accuracy.density_errors, strict=True
        )
    ]
    columns = ("points per cell", "cells", "wrong, of the cells", "wrong, of the density")
    return Exhibit((Table("probability in the wrong place", columns, rows),), figure)


def samples() -> Exhibit:
    """Figure 4.3."""
    figure, image, source, cumulative = _frame()
    found = particles.passing()
    count = found.x.size
    foot = 0.035
    rug(source, found.x, (-2.0 * foot, -foot))
    rug(image, found.y, (-2.0 * foot, -foot), upright=False)
    cumulative.step(np.sort(found.y), (np.arange(count) + 1.0) / count, where="post", color=BLUE, linewidth=1)
    cumulative.plot(_FINE, transform.cumulative(_FINE), color=RED, linewidth=1)
    cumulative.plot([], [], color=BLUE, label=f"{count} particles")
    cumulative.plot([], [], color=RED, label="exact")
    label(cumulative, "share of Y up to y", "y", "probability")
    cumulative.legend(loc="lower right")
    mean, variance = transform.moments()
    largest = float(np.abs((np.arange(count) + 0.5) / count - transform.cumulative(np.sort(found.y))).max())
    rows = [
        ("mean of Y", number(mean), number(found.mean), number(math.sqrt(variance / count))),
        ("variance of Y", number(variance), number(found.variance), ""),
        ("largest difference of the shares", "0", number(largest), f"{1.36 / math.sqrt(count):.4f} (95 %)"),
    ]
    columns = ("what", "exact", f"{count} particles", "to be expected of chance")
    return Exhibit((Table("the particles against the exact distribution", columns, rows),), figure)


def densities() -> Exhibit:
    """Figure 4.5."""
    found = extraction.extraction(points=301)
    figure = sheet(9.6, 5.4)
    shown = panels(figure, 2, 3, sharex=True, sharey=True)
    titles = {
        "particles": "(a) particles, and the exact density",
        "gaussian": "(b) Gaussian; dashed: of the exact moments",
        "histogram": "(c) histogram",
        "kernel": "(d) kernels",
        "mixture": "k-means mixture",
        "tree": "density tree",
    }
    for axis, (name, title) in zip(shown, titles.items(), strict=True):
        axis.fill_between(found.y, found.exact, color=PALE, linewidth=0, label="exact")
        if name == "particles":
            rug(axis, found.particles, (-0.08, -0.03))
        else:
            axis.plot(found.y, found.densities[name], color=BLUE, linewidth=1.2, label="extracted")
        if name == "gaussian":
            axis.plot(found.y, found.exact_gaussian, color=RED, linewidth=1, linestyle="--")
        label(axis, title, "y", "density")
        axis.set_xlim(-0.8, 2.8)
    shown[1].legend(loc="upper left")
    rows = [(name, str(found.numbers[name]), number(error, 3)) for name, error in found.error.items()]
    columns = ("density", "numbers that it keeps", "wrong probability")
    return Exhibit(
        (Table(f"densities of {found.particles.size} particles against the exact one", columns, rows),),
        figure,
    )


def chance() -> Exhibit:
    """Figure 4.6."""
    found = particles.variability()
    figure = sheet(9.6, 5.0)
    grid = figure.add_gridspec(2, 4, width_ratios=(1, 1, 1, 1.3))
    for row, count in enumerate(particles.COUNTS):
        drawn = particles.draws(count, points=201)
        for column, (points, density) in enumerate(zip(drawn.particles, drawn.densities, strict=True)):
            axis = figure.add_subplot(grid[row, column])
            axis.fill_between(drawn.y, transform.density(drawn.y), color=PALE, linewidth=0)
            axis.plot(drawn.y, density, color=BLUE, linewidth=1.2)
            rug(axis, points, (-0.08, -0.03))
            label(axis, f"{count} particles, draw {column + 1}", "y", "density")
            axis.set_ylim(-0.1, 1.1)
            axis.set_xlim(*_SPAN)
    above, below = figure.add_subplot(grid[0, 3]), figure.add_subplot(grid[1, 3])
    above.loglog(found.counts, found.mean_errors, "o", color=BLUE, markersize=4, label="measured")
    above.loglog(found.counts, found.theory, color=GREY, linestyle="--", label="σ/√M")
    label(above, "mean of the particles", "particles M", "error, root mean square")
    above.legend()
    below.errorbar(
        found.counts,
        found.density_errors,
        found.density_spreads,
        fmt="o-",
        color=BLUE,
        markersize=4,
        capsize=2,
    )
    below.set_xscale("log")
    below.set_ylim(0.0, None)
    label(below, "kernel density, ± std. deviation", "particles M", "wrong probability")
    rows = [
        (f"{count:,}", *(number(float(value), 3) for value in values))
        for count, *values in zip(
            found.counts,
            found.mean_errors,
            found.theory,
            found.density_errors,
            found.density_spreads,
            strict=True,
        )
    ]
    columns = ("particles", "error of the mean", "σ/√M", "wrong probability", "its std. deviation")
    return Exhibit((Table("what differs from draw to draw", columns, rows),), figure)


def _frame() -> tuple[Figure, Axes, Axes, Axes]:
    """Lay out Y, the function and X as the book does, and a panel for the error; return all but the function's."""
    figure = sheet(7.4, 6.2)
    image, function, fourth, source = panels(figure, 2, 2)
    function.plot(_FINE, transform.function(_FINE), color=RED, linewidth=1.4)
    label(function, "function y = g(x)", "x", "y")
    source.fill_between(
        _FINE, normal.density(_FINE, transform.MEAN, transform.SIGMA), color=PALE, linewidth=0, label="exact"
    )
    label(source, "X, a Gaussian", "x", "density")
    image.fill_betweenx(_FINE, transform.density(_FINE), color=PALE, linewidth=0, label="exact")
    label(image, "Y = g(X)", "density", "y")
    for axis in (function, source):
        axis.set_xlim(*_SPAN)
    for axis in (function, image):
        axis.set_ylim(*_SPAN)
    return figure, image, source, fourth
