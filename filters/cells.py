"""How a density over states becomes a number for each cell: the mean state in its place, or the integral.

*Probabilistic Robotics*, 4.1.2 and 4.1.3, both behind one protocol:

==================  ================================  ===========================================
what                :class:`CellMean`                 :class:`CellIntegral`
==================  ================================  ===========================================
measurement         p(z | mean state), eq. 4.4, 4.7   mean over the cell, eq. 4.6
motion, source      from the mean state               mean over the source cell, eq. 4.8, 4.9
motion, target      density at the mean state,        probability of the target cell, eq. 4.9
                    normalised, eq. 4.5, 4.10
==================  ================================  ===========================================

Integrals over the source and of the likelihood are by Gauss and Legendre's rule, those of the Gaussian over
the target are in closed form.
"""

from __future__ import annotations

import math
from itertools import product
from typing import NamedTuple, Protocol

import numpy as np

from filters.grid import Array, Columns, LogDensity, broadcasts
from filters.kernels import histogram as kernels


class Nodes(NamedTuple):
    """Points of a cell that stand for it.

    Attributes
    ----------
    offsets : (n, dimension) float64
        From the cell's centre, in widths of the cell.
    weights : (n,) float64
        That sum to one.
    """

    offsets: Array
    weights: Array


class Cells(Protocol):
    """What a histogram needs to know of a rule for cells."""

    def nodes(self, dimension: int) -> Nodes:
        """Points over which a likelihood, or where a cell's motion leads, is averaged."""
        ...

    def shares(self, distances: Array, width: float, sigma: float) -> Array:
        """Probabilities of target cells along an axis under a Gaussian.

        Parameters
        ----------
        distances : (n, window) float64
            Of target cells' centres from the Gaussian's mean.
        width : float
            Of the cells.
        sigma : float
            Standard deviation of the Gaussian, positive.

        Returns
        -------
        (n, window) float64
            Each row sums to one.
        """
        ...


class CellMean:
    """Each cell by its mean state: equations 4.3 to 4.5."""

    def nodes(self, dimension: int) -> Nodes:
        """Return the mean state only."""
        return Nodes(np.zeros((1, dimension)), np.ones(1))

    def shares(self, distances: Array, width: float, sigma: float) -> Array:
        """Density at the cells' mean states, normalised (eq. 4.5; the equal volumes cancel)."""
        exponent = -0.5 * np.square(distances / sigma)
        density = np.exp(exponent - exponent.max(axis=1, keepdims=True))
        return density / density.sum(axis=1, keepdims=True)


class CellIntegral:
    """Each cell by integrals over it: equations 4.6 and 4.9, exact for a belief constant in each cell.

    Parameters
    ----------
    order : int
        Points along each axis, 1 to 32: polynomials up to degree ``2 * order - 1`` are integrated exactly.

    Raises
    ------
    ValueError
        Another order.
    """

    def __init__(self, order: int) -> None:
        if not 1 <= order <= 32:
            raise ValueError(f"cell integral: order must be 1 to 32, got {order}")
        self.order = order

    def nodes(self, dimension: int) -> Nodes:
        """Return the points of Gauss and Legendre's rule, ``order`` ** ``dimension`` of them."""
        points, weights = np.polynomial.legendre.leggauss(self.order)
        offsets = np.array(list(product(0.5 * points, repeat=dimension)))
        return Nodes(offsets, np.array([math.prod(w) for w in product(0.5 * weights, repeat=dimension)]))

    def shares(self, distances: Array, width: float, sigma: float) -> Array:
        """Probability of each cell, as a difference of two cumulative ones."""
        upper, lower = (distances + 0.5 * width) / sigma, (distances - 0.5 * width) / sigma
        share = np.empty_like(distances)
        kernels.probability_between(lower.ravel(), upper.ravel(), share.reshape(-1))
        return share / share.sum(axis=1, keepdims=True)


def log_mean(function: LogDensity, centres: Columns, widths: Columns | Array, nodes: Nodes) -> Array:
    """Logarithm of the mean of exp(function) over each cell (eq. 4.6, or 4.7 with one node).

    Parameters
    ----------
    function : callable
        Logarithm of a density at the states.
    centres : one array for each axis
        Of the cells; they broadcast.
    widths : one number or array for each axis
        Of the cells.
    nodes : Nodes
        Where in each cell.

    Returns
    -------
    float64 array
        That broadcasts against the cells.

    Raises
    ------
    ValueError
        The function gave NaN or plus infinity, or what does not broadcast against the cells.
    """
    shape = np.broadcast_shapes(*(centre.shape for centre in centres))
    total: Array | None = None
    for offset, weight in zip(nodes.offsets, nodes.weights, strict=True):
        states = [
            centre + share * width for centre, share, width in zip(centres, offset, widths, strict=True)
        ]
        logs = _checked_logs(np.asarray(function(states), np.float64), shape) + math.log(weight)
        total = logs if total is None else np.logaddexp(total, logs)
    if total is None:
        raise ValueError("cells: a rule must have at least one node")
    return total


def _checked_logs(logs: Array, shape: tuple[int, ...]) -> Array:
    if not broadcasts(logs.shape, shape):
        raise ValueError(
            f"log likelihood: one number for each cell, {shape}, or what broadcasts to it, is needed; "
            f"got {logs.shape}"
        )
    if np.isnan(logs).any() or (logs == math.inf).any():
        raise ValueError("log likelihood: every number must be below infinity, got NaN or plus infinity")
    return logs
