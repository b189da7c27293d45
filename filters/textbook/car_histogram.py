"""Exercise 1: the car of :mod:`filters.textbook.car` by the histogram filter.

The histogram filter takes noise that is independent along the axes; the car's is not, it moves x and v together. So the
grid lies over (q, v) with q = x - v/2, in which only v has noise:

    q' = q + v,   v' = v + a        the same as x' = x + v + a/2, v' = v + a

In (x, v) the cells are parallelograms, as good a decomposition as any (equation 4.1). With cells as wide in q as in v,
and one centred at v = 0, every shift q + v is a whole number of cells. Then the cell means (equations 4.3 to 4.5) lose
nothing between the cells, and the covariance is exact but for a cell's own width²/12. The integrals (4.6 to 4.9) are
exact for a belief that is constant in each cell; the car's is not, and every step adds what is assumed within them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from filters.cells import CellIntegral, CellMean, Cells
from filters.grid import Axis, Columns, Grid
from filters.histogram import HistogramFilter
from filters.textbook import car, normal
from filters.textbook.car import Gaussians

REACH = (28.0, 11.0)
"""How far the grid goes on either side in q and v, metres and metres per second: five standard deviations at t = 5."""
WIDTH = 0.5
"""Of a cell along both, metres and metres per second."""
WIDTHS = (4.0, 2.0, 1.0, 0.5)
SHEAR = np.array([[1.0, 0.5], [0.0, 1.0]])
"""(x, v) from (q, v)."""
RULES: dict[str, Cells] = {"cell means": CellMean(), "cell integrals": CellIntegral(2)}
_POINTS = 16


@dataclass(frozen=True)
class Histogram:
    """The belief over a grid.

    Attributes
    ----------
    grid : Grid
        Axes q and v.
    beliefs : tuple of (q cells, v cells) float64
        Probabilities at t = 0 … 5, and last at t = 5 after the measurement.
    moments : Gaussians
        Means and covariances of them in (x, v), a cell's own variance included.
    departed : float
        Probability that left the grid.
    distance : float
        Total variation between the last belief and the exact probabilities of the cells, 0 to 1.
    """

    grid: Grid
    beliefs: tuple[NDArray[np.float64], ...]
    moments: Gaussians
    departed: float
    distance: float


@dataclass(frozen=True)
class Accuracy:
    """What finer cells gain.

    Attributes
    ----------
    rule : str
    widths : (n,) float64
        Of a cell along q and v, metres and metres per second.
    cells : (n,) int64
    distances : (n,) float64
        Total variation after the measurement.
    covariance_errors : (n,) float64
        Frobenius norm of the covariance's error over that of the covariance, after the measurement.
    """

    rule: str
    widths: NDArray[np.float64]
    cells: NDArray[np.int64]
    distances: NDArray[np.float64]
    covariance_errors: NDArray[np.float64]


def histogram(width: float = WIDTH, cells: Cells | None = None) -> Histogram:
    """Exercise 1 by the histogram filter: five predictions, then z = 5."""
    grid = _grid(width)
    belief = HistogramFilter(grid, cells)
    start = np.zeros(grid.shape)
    start.reshape(-1)[grid.cell_of([[0.0, 0.0]])] = 1.0
    belief.reset(start)
    beliefs = [belief.belief.copy()]
    moments = [_moments(belief)]
    for _ in range(car.STEPS):
        belief.predict(_roll, [0.0, 1.0])
        beliefs.append(belief.belief.copy())
        moments.append(_moments(belief))
    log_evidence = belief.update(_log_likelihood)
    beliefs.append(belief.belief.copy())
    moments.append(_moments(belief))
    means, covariances = zip(*moments, strict=True)
    exact = car.kalman()
    probabilities = cell_probabilities(grid, exact.means[-1], exact.covariances[-1])
    return Histogram(
        grid,
        tuple(beliefs),
        Gaussians(np.array(means), np.array(covariances), log_evidence),
        belief.departed,
        0.5 * float(np.abs(beliefs[-1] - probabilities).sum()),
    )


def accuracy(rule: str, widths: tuple[float, ...] = WIDTHS) -> Accuracy:
    """Exercise 1 over several widths of the cells."""
    exact: NDArray[np.float64] = car.kalman().covariances[-1]
    runs = [histogram(width, RULES[rule]) for width in widths]
    errors = [np.linalg.norm(run.moments.covariances[-1] - exact) / np.linalg.norm(exact) for run in runs]
    return Accuracy(
        rule,
        np.array(widths),
        np.array([run.grid.size for run in runs]),
        np.array([run.distance for run in runs]),
        np.array(errors, np.float64),
    )


def cell_probabilities(grid: Grid, mean: ArrayLike, covariance: ArrayLike) -> NDArray[np.float64]:
    """Probabilities of the cells under a Gaussian of (x, v): q given v in closed form, over v by the mid-point rule."""
    back = np.linalg.inv(SHEAR)
    centre, spread = back @ np.asarray(mean, np.float64), back @ np.asarray(covariance, np.float64) @ back.T
    q, v = grid.axes
    slope = spread[0, 1] / spread[1, 1]
    sigma = np.sqrt(spread[0, 0] - slope * spread[0, 1])
    fine = v.low + (np.arange(v.cells * _POINTS) + 0.5) * v.width / _POINTS
    edges = q.low + np.arange(q.cells + 1) * q.width
    below = normal.cumulative(edges[:, None], centre[0] + slope * (fine - centre[1]), sigma)
    joint = np.diff(below, axis=0) * normal.density(fine, centre[1], np.sqrt(spread[1, 1]))
    return joint.reshape(q.cells, v.cells, _POINTS).sum(axis=2) * v.width / _POINTS


def _grid(width: float) -> Grid:
    """Cells centred on whole multiples of their width."""
    axes: list[Axis] = []
    for reach in REACH:
        beside = round(reach / width)
        axes.append(Axis(-(beside + 0.5) * width, (beside + 0.5) * width, 2 * beside + 1))
    return Grid(axes)


def _moments(belief: HistogramFilter) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    mean, covariance = belief.moments()
    return SHEAR @ mean, SHEAR @ covariance @ SHEAR.T


def _roll(states: Columns) -> list[ArrayLike]:
    q, v = states
    return [q + v, v]


def _log_likelihood(states: Columns) -> NDArray[np.float64]:
    q, v = states
    return np.log(normal.density(car.MEASURED, q + 0.5 * v, np.sqrt(car.NOISE)))
