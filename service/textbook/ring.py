"""Exercises 2 and 5: the ring, by the histogram filter, the extended Kalman filter and particles."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from filters.textbook import ring, ring_histogram
from filters.textbook.ring import Position
from service.textbook.exhibit import Exhibit, Table, number
from service.textbook.style import BLUE, GREEN, GREY, ORANGE, RED, cloud, ellipse, label, panels, sheet

_COLUMNS = ("belief", "mean x, m", "mean y, m", "Var x, m²", "Var y, m²", "log p(z), log(1/m)")
_REACH = 1.5
_COUNTS = (25, 400, 25_600)
_SLICES = 8


def histogram() -> Exhibit:
    """Exercise 2."""
    exact, extended, found = ring.exact(), ring.extended(), ring_histogram.histogram()
    resolved = ring_histogram.resolution()
    figure: Any = sheet(9.6, 8.2)
    above, below = figure.subfigures(2, 1, height_ratios=(3, 4.4))
    before, after, accuracy = panels(above, 1, 3)
    side = found.grid.axes[0]
    edges = np.linspace(side.low, side.high, side.cells + 1)
    for axis, belief, row in ((before, found.predicted, 0), (after, found.corrected, 1)):
        density = belief.sum(axis=2) / side.width**2
        axis.pcolormesh(edges, edges, density.T, cmap="Blues", rasterized=True)
        _frame(axis, row)
    for width, distances, colour in zip(
        resolved.widths, resolved.distances, (ORANGE, GREEN, BLUE), strict=True
    ):
        accuracy.loglog(
            resolved.headings,
            distances[:, 0],
            "o-",
            color=colour,
            label=f"cells of {width:g} m",
            markersize=4,
        )
    label(accuracy, "after the motion: distance from exact", "cells of the heading", "wrong probability")
    accuracy.legend()
    per_slice = found.grid.shape[2] // _SLICES
    below.suptitle("by heading: after the motion (blue), after z (red)", fontsize=9)
    centres = side.centres
    top = float(found.corrected.max())
    for place, axis in enumerate(panels(below, 2, _SLICES // 2, sharex=True, sharey=True)):
        chosen = slice(place * per_slice, (place + 1) * per_slice)
        moved = found.predicted[:, :, chosen].sum(axis=2)
        axis.pcolormesh(edges, edges, moved.T, cmap="Blues", rasterized=True)
        measured = found.corrected[:, :, chosen].sum(axis=2)
        axis.contour(
            centres, centres, measured.T, levels=[0.5 * top, 2.0 * top], colors=[RED], linewidths=1.0
        )
        first = -180.0 + place * 360.0 / _SLICES
        label(axis, f"{first:.0f}° to {first + 360.0 / _SLICES:.0f}°", "x, m", "y, m")
        axis.set_aspect("equal")
        axis.set_xlim(-_REACH, _REACH)
        axis.set_ylim(-_REACH, _REACH)
    rows = [
        (number(width), str(headings), f"{cells:,}", number(float(first), 3), number(float(second), 3))
        for width, *rest in zip(resolved.widths, resolved.cells, resolved.distances, strict=True)
        for headings, cells, (first, second) in zip(resolved.headings, *rest, strict=True)
    ]
    columns = ("cell in x and y, m", "headings", "cells", "wrong after motion", "wrong after z")
    return Exhibit(
        (
            _moments(
                ("exact", exact), ("histogram filter", found.moments), ("extended Kalman filter", extended)
            ),
            Table("probability in the wrong cells of (x, y), by resolution", columns, rows),
        ),
        figure,
    )


def particles() -> Exhibit:
    """Exercise 5."""
    exact, converged = ring.exact(), ring.convergence()
    clouds = [ring.particles(count, seed=2) for count in _COUNTS]
    figure = sheet(9.6, 6.2)
    shown = panels(figure, 2, 3)
    for axis, found in zip(shown, clouds, strict=False):
        points = found.poses[:4_000]
        opacity = found.weights[:4_000] / found.weights.max()
        size = 14.0 if found.count < 100 else 4.0
        cloud(axis, points[:, 0], points[:, 1], 0.25, GREY, size)
        cloud(axis, points[:, 0], points[:, 1], opacity, BLUE, size)
        _frame(axis, 1, extended=False)
        axis.set_title(f"{found.count:,} particles")
    curves = (
        (converged.mean_errors, BLUE, "posterior mean, m", "error, root mean square, m"),
        (converged.upper_errors, GREEN, "share of the upper place (exact: 1/2)", "error, root mean square"),
    )
    for axis, (errors, colour, title, unit) in zip(shown[3:5], curves, strict=True):
        axis.loglog(converged.counts, errors, "o-", color=colour, markersize=4, label="measured")
        reference = errors[-1] * math.sqrt(converged.counts[-1]) / np.sqrt(converged.counts)
        axis.loglog(converged.counts, reference, color=GREY, linestyle="--", label="falls as 1/√M")
        label(axis, title, "particles M", unit)
        axis.legend()
    shown[5].semilogx(converged.counts, converged.lost, "o-", color=RED, markersize=4)
    label(shown[5], "one of the two places lost,\nafter five resamplings", "particles M", "share of the runs")
    shown[5].set_ylim(-0.02, 1.0)
    rows = [
        (f"{count:,}", *(number(float(value), 3) for value in values))
        for count, *values in zip(
            converged.counts, converged.mean_errors, converged.upper_errors, converged.lost, strict=True
        )
    ]
    columns = ("particles", "mean, m", "share of the upper place", "runs with a place lost")
    beliefs = ((f"{found.count:,} particles", found.moments) for found in clouds)
    return Exhibit(
        (
            _moments(("exact", exact), *beliefs),
            Table("errors after the measurement, root mean square", columns, rows),
        ),
        figure,
    )


def _frame(axis: Axes, row: int, *, extended: bool = True) -> None:
    """Draw the exact density's contours and the extended Kalman filter's ellipse."""
    fine = np.linspace(-_REACH, _REACH, 151)
    x, y = np.meshgrid(fine, fine)
    density = ring.posterior(x, y) if row else ring.density(x, y)
    axis.contour(x, y, density, levels=[0.15 * float(density.max())], colors=[GREEN], linewidths=1.0)
    axis.plot([], [], color=GREEN, linewidth=1.0, label="exact")
    if extended:
        belief = ring.extended()
        axis.plot(
            *ellipse(belief.means[row], belief.covariances[row]), color=RED, linewidth=1.2, label="EKF, 95 %"
        )
        axis.legend(loc="lower left")
    if row:
        axis.axvline(ring.MEASURED, color=GREY, linewidth=1, linestyle="--")
    label(axis, f"after z = {ring.MEASURED:g} m" if row else "after the motion", "x, m", "y, m")
    axis.set_aspect("equal")
    axis.set_xlim(-_REACH, _REACH)
    axis.set_ylim(-_REACH, _REACH)


def _moments(*beliefs: tuple[str, Position]) -> Table:
    rows = [
        (
            f"{name}, {when}",
            *(number(round(float(value), 10) + 0.0) for value in (*mean, covariance[0, 0], covariance[1, 1])),
            f"{belief.log_evidence:.4f}" if when == "after z" else "",
        )
        for name, belief in beliefs
        for when, mean, covariance in zip(
            ("after the motion", "after z"), belief.means, belief.covariances, strict=True
        )
    ]
    return Table("position", _COLUMNS, rows)
