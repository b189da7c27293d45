"""A belief of several hypotheses as a density: a mixture of Gaussians over north and east.

Scored by two figures that hold for one Gaussian and for many: the logarithm of the density where the truth is (a proper
scoring rule: no forecast but the right one has a better mean; Gneiting and Raftery, 2007), and how large a region of
highest density must be to hold the truth (Hyndman, 1996): of a consistent filter, that share is uniform over 0 … 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

POINTS = 256
"""Points of every component by which the content of a region is measured."""

LEAST_VARIANCE = 1e-6
"""Square metres; the published figures are rounded, and a variance of none has no density."""


@cache
def _normal_points() -> Array:
    """Return evenly spread draws of the standard normal distribution of two dimensions, (POINTS, 2).

    A golden-section lattice through Box and Muller's transform: no chance in it, so that a score is reproducible.
    """
    index = np.arange(POINTS)
    radius = np.sqrt(-2.0 * np.log((index + 0.5) / POINTS))
    angle = 2.0 * math.pi * (index * 0.5 * (math.sqrt(5.0) - 1.0) % 1.0)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


@dataclass(frozen=True)
class Mixture:
    """Hypotheses of one tick.

    Attributes
    ----------
    weights : (k,) float64
        They add up to one, less what the belief holds elsewhere.
    means : (k, 2) float64
        North and east, metres.
    covariances : (k, 3) float64
        nn, ne, ee of each, m².
    """

    weights: Array
    means: Array
    covariances: Array

    def log_density(self, points: Array) -> Array:
        """Return the natural logarithm of the density (per m²) at each point; points (n, 2), result (n,)."""
        nn, ne, ee = self._regular().T
        determinant = nn * ee - ne**2
        dn = points[:, None, 0] - self.means[:, 0]
        de = points[:, None, 1] - self.means[:, 1]
        square = (ee * dn**2 - 2.0 * ne * dn * de + nn * de**2) / determinant
        with np.errstate(divide="ignore"):
            parts = np.log(self.weights) - math.log(2.0 * math.pi) - 0.5 * np.log(determinant) - 0.5 * square
        greatest = parts.max(axis=1)
        return greatest + np.log(np.exp(parts - greatest[:, None]).sum(axis=1))

    def level(self, north: float, east: float) -> float:
        """Return the content, 0…1, of the smallest region of highest density that holds a place."""
        here = self.log_density(np.array([[north, east]]))[0]
        content = 0.0
        for weight, mean, (nn, ne, ee) in zip(self.weights, self.means, self._regular(), strict=True):
            root = math.sqrt(nn)
            lower = np.array([[root, 0.0], [ne / root, math.sqrt(max(0.0, ee - ne * ne / nn))]])
            inside: NDArray[np.bool_] = self.log_density(mean + _normal_points() @ lower.T) > here
            content += weight * float(np.mean(inside))
        return content

    def _regular(self) -> Array:
        covariances = self.covariances.copy()
        covariances[:, [0, 2]] = np.maximum(covariances[:, [0, 2]], LEAST_VARIANCE)
        bound = 0.999 * np.sqrt(covariances[:, 0] * covariances[:, 2])
        covariances[:, 1] = np.clip(covariances[:, 1], -bound, bound)
        return covariances
