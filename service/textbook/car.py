"""Exercises 1 and 4: the car, by the histogram filter and by particles, against the Kalman filter."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from filters.textbook import car, car_histogram
from filters.textbook.car import Gaussians
from filters.textbook.car_histogram import SHEAR
from service.textbook.exhibit import Exhibit, Table, number, vector
from service.textbook.style import BLUE, GREEN, GREY, ORANGE, RED, cloud, ellipse, label, sheet

_COLUMNS = ("belief", "mean x, m", "mean v, m/s", "Var x, m²", "Cov, m²/s", "Var v, m²/s²")
_SHOWN = 1_000


def histogram() -> Exhibit:
    """Exercise 1."""
    exact, found = car.kalman(), car_histogram.histogram()
    accuracies = [car_histogram.accuracy(rule) for rule in car_histogram.RULES]
    figure, small, large = _sheet()
    q, v = (np.linspace(axis.low, axis.high, axis.cells + 1) for axis in found.grid.axes)
    corners = SHEAR @ np.array(np.meshgrid(q, v, indexing="ij")).reshape(2, -1)
    x, y = corners.reshape(2, q.size, v.size)
    for row, axis in enumerate(small, 1):
        density = found.beliefs[row] / found.grid.volume
        axis.pcolormesh(x, y, density, cmap="Blues", rasterized=True)
        _frame(axis, exact, row)
    for accuracy, colour in zip(accuracies, (BLUE, ORANGE), strict=True):
        large.loglog(
            accuracy.cells, accuracy.distances, "o-", color=colour, label=accuracy.rule, markersize=4
        )
    label(large, "after z: distance from the exact belief", "cells", "probability in the wrong cells")
    large.legend()
    rows = [
        (accuracy.rule, number(width), f"{cells:,}", number(distance), number(error))
        for accuracy in accuracies
        for width, cells, distance, error in zip(
            accuracy.widths, accuracy.cells, accuracy.distances, accuracy.covariance_errors, strict=True
        )
    ]
    columns = ("rule", "cell, m and m/s", "cells", "wrong probability", "covariance error, relative")
    return Exhibit(
        (
            Table("Kalman filter, exact", _COLUMNS, _moments(exact)),
            Table(f"histogram filter, {found.grid.size:,} cells", _COLUMNS, _moments(found.moments)),
            _evidence(("Kalman filter", exact), ("histogram filter", found.moments)),
            Table("after the measurement, by the size of the cells", columns, rows),
        ),
        figure,
    )


def particles() -> Exhibit:
    """Exercise 4."""
    exact, found, converged = car.kalman(), car.particles(10_000, seed=1), car.convergence()
    figure, small, large = _sheet()
    for row, axis in enumerate(small, 1):
        points = found.clouds[min(row, car.STEPS)][:_SHOWN]
        weights = found.weights[:_SHOWN] / found.weights.max() if row > car.STEPS else np.ones(_SHOWN)
        cloud(axis, points[:, 0], points[:, 1], 0.5 * weights, BLUE)
        _frame(axis, exact, row)
    curves = (
        (converged.mean_errors, BLUE, "mean, in standard deviations"),
        (converged.covariance_errors, GREEN, "covariance, relative"),
        (converged.evidence_errors, ORANGE, "log p(z)"),
    )
    for errors, colour, name in curves:
        large.loglog(converged.counts, errors, "o-", color=colour, label=name, markersize=4)
    large.loglog(converged.counts, 2.0 / np.sqrt(converged.counts), color=GREY, linestyle="--", label="2/√M")
    label(large, "after z: error against the Kalman filter", "particles M", "error, root mean square")
    large.legend()
    rows = [
        (f"{count:,}", *(number(float(error), 3) for error in errors))
        for count, *errors in zip(
            converged.counts,
            converged.mean_errors,
            converged.covariance_errors,
            converged.evidence_errors,
            strict=True,
        )
    ]
    columns = ("particles", "mean, std. deviations", "covariance, relative", "log p(z)")
    return Exhibit(
        (
            Table("Kalman filter, exact", _COLUMNS, _moments(exact)),
            Table(f"{found.count:,} particles", _COLUMNS, _moments(found.moments)),
            _evidence(("Kalman filter", exact), ("particles", found.moments)),
            Table("errors after the measurement, root mean square", columns, rows),
        ),
        figure,
    )


def _sheet() -> tuple[Figure, list[Axes], Axes]:
    """Make six panels for the beliefs and a wide one for the errors."""
    figure = sheet(9.6, 5.4)
    grid = figure.add_gridspec(2, 4)
    small = [figure.add_subplot(grid[place // 4, place % 4]) for place in range(6)]
    return figure, small, figure.add_subplot(grid[1, 2:])


def _frame(axis: Axes, exact: Gaussians, row: int) -> None:
    """Draw the Kalman filter's ellipse, and name the panel."""
    axis.plot(*ellipse(exact.means[row], exact.covariances[row]), color=RED, linewidth=1.2)
    after = row > car.STEPS
    title = f"t = {car.STEPS}, after z = {car.MEASURED:g} m" if after else f"t = {row}"
    label(axis, title, "position x, m", "velocity v, m/s")
    axis.set_xlim(-20.0, 20.0)
    axis.set_ylim(-7.0, 7.0)
    if after:
        axis.axvline(car.MEASURED, color=GREY, linewidth=1, linestyle="--")


def _moments(belief: Gaussians) -> list[tuple[str, ...]]:
    names = [f"t = {time}" for time in range(car.STEPS + 1)] + [f"t = {car.STEPS}, after z"]
    return [_row(name, m, c) for name, m, c in zip(names, belief.means, belief.covariances, strict=True)]


def _row(name: str, mean: NDArray[np.float64], covariance: NDArray[np.float64]) -> tuple[str, ...]:
    values = (*mean, covariance[0, 0], covariance[0, 1], covariance[1, 1])
    return name, *(number(round(float(value), 12) + 0.0) for value in values)


def _evidence(*beliefs: tuple[str, Gaussians]) -> Table:
    rows = [(name, f"{belief.log_evidence:.4f}", vector(belief.means[-1])) for name, belief in beliefs]
    return Table("evidence of z", ("filter", "log p(z), log(1/m)", "mean after z (m, m/s)"), rows)
