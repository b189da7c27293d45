"""A belief as one Gaussian, figure 4.5 (b): mean and covariance of the particles, and nothing else of them.

Where a dimension is an angle the Gaussian is wound on the circle in that dimension. How large a region about
the mean holds how much of it: ``gaussian.py``.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from filters.density import circular as angles
from filters.density.circular import Flags
from filters.density.protocol import Array, DensityMoments
from filters.density.weighted import asked, weighted

THIN = 1e-6
"""Least standard deviation of an extracted Gaussian in any direction, relative to the dimensions' deviations."""


class Gaussian:
    """A normal density, wound on the circle in the dimensions that wrap.

    Parameters
    ----------
    mean : (d,) array
    covariance : (d, d) array
        Symmetric, positive definite; of the normal before it is wound.
    circular : sequence of d bool, optional
        Which dimensions wrap; none if not given.

    Raises
    ------
    ValueError
        Shapes that do not fit, numbers that are not finite, or a covariance that is not positive definite.
    """

    def __init__(
        self, mean: ArrayLike, covariance: ArrayLike, circular: Sequence[bool] | None = None
    ) -> None:
        centre = np.array(mean, np.float64, ndmin=1)
        spread = np.array(covariance, np.float64, ndmin=2)
        size = centre.size
        flags = np.zeros(size, np.bool_) if circular is None else np.array(circular, np.bool_)
        if centre.shape != (size,) or spread.shape != (size, size) or flags.shape != (size,):
            raise ValueError(
                f"Gaussian: mean (d,), covariance (d, d) and circular (d,) are needed, got {centre.shape}, "
                f"{spread.shape} and {flags.shape}"
            )
        if not (np.isfinite(centre).all() and np.isfinite(spread).all()):
            raise ValueError(
                f"Gaussian: mean and covariance must be finite, got {centre} and {spread.tolist()}"
            )
        try:
            root = np.linalg.cholesky(spread)
        except np.linalg.LinAlgError:
            raise ValueError(
                f"Gaussian: covariance must be positive definite, got {spread.tolist()}"
            ) from None
        self.mean: Array = angles.wrap_columns(centre, flags)
        self.covariance: Array = spread
        self.circular: Flags = flags
        self._root: Array = np.asarray(root, np.float64)
        self._whitener: Array = np.asarray(np.linalg.inv(root), np.float64)
        self._height = math.exp(-0.5 * size * math.log(2.0 * math.pi)) / float(np.prod(np.diag(root)))

    def evaluate(self, points: ArrayLike) -> Array:
        """Return the density at points; see :class:`filters.density.protocol.Density`."""
        away = angles.difference(asked("Gaussian", points, self.mean.size), self.mean, self.circular)
        total = np.zeros(len(away))
        for shift in self._shifts():
            white = (away + shift) @ self._whitener.T
            total += np.exp(-0.5 * np.einsum("ij,ij->i", white, white))
        return self._height * total

    def draw(self, count: int, generator: np.random.Generator) -> Array:
        """Draw points; see :class:`filters.density.protocol.Density`."""
        noise = generator.standard_normal((count, self.mean.size))
        return angles.wrap_columns(self.mean + noise @ self._root.T, self.circular)

    def moments(self) -> DensityMoments:
        """Return mean and covariance, that of angles of wrapped differences.

        Exact but for the covariance of two dimensions that both wrap, which is to first order in their
        correlation where they are wider than 0.37 rad.
        """
        return DensityMoments(self.mean.copy(), self.second_moment_about(self.mean))

    def resultant(self) -> Array:
        """Length of the mean vector on the circle, (d,): exp(-sigma²/2) where a dimension wraps, else one."""
        return np.where(self.circular, np.exp(-0.5 * np.diag(self.covariance)), 1.0)

    def second_moment_about(self, point: Array) -> Array:
        """Return the mean product (d, d) of the differences from a point, those of angles wrapped."""
        offset = angles.difference(self.mean, point, self.circular)
        first, slope, square = offset.copy(), np.ones(offset.size), offset**2 + np.diag(self.covariance)
        for j in np.flatnonzero(self.circular):
            first[j], square[j], slope[j] = angles.wound(
                float(offset[j]), math.sqrt(float(self.covariance[j, j]))
            )
        second = np.outer(first, first) + self.covariance * np.outer(slope, slope)
        np.fill_diagonal(second, square)
        return second

    def _shifts(self) -> list[Array]:
        """Whole turns that matter, each a (d,) vector."""
        deviation = np.sqrt(np.diag(self.covariance))
        last = np.where(self.circular, (REACH_TURNS * deviation + 0.5).astype(int), 0)
        turns = [range(-int(k), int(k) + 1) for k in last]
        return [angles.TURN * np.array(each, np.float64) for each in itertools.product(*turns)]


REACH_TURNS = angles.REACH / angles.TURN


def of_moments(moments: DensityMoments, circular: Sequence[bool] | Flags) -> Gaussian:
    """Return the Gaussian of these moments: wound so that its angles have the deviation given.

    A covariance that is flat in some direction (few particles, or all alike) is widened there to ``THIN`` of
    the dimensions' deviations, since a density has none.
    """
    flags = np.asarray(circular, np.bool_)
    deviation = np.sqrt(np.maximum(np.diag(moments.covariance), 0.0))
    size = np.where(deviation > 0.0, deviation, max(float(deviation.max()), 1.0) * THIN)
    correlation = 0.5 * (moments.covariance + moments.covariance.T) / np.outer(size, size)
    values, vectors = np.linalg.eigh(correlation)
    if values[0] < THIN**2:
        correlation = (vectors * np.maximum(values, THIN**2)) @ vectors.T
    stretch = size.copy()
    for j in np.flatnonzero(flags):
        stretch[j] = angles.unwound(float(size[j]))
    return Gaussian(moments.mean, correlation * np.outer(stretch, stretch), [bool(flag) for flag in flags])


def gaussian(
    points: ArrayLike, weights: ArrayLike | None = None, circular: Sequence[bool] | None = None
) -> Gaussian:
    """Extract a Gaussian: mean and covariance of the particles; an :class:`~filters.density.protocol.Extractor`.

    Raises
    ------
    ValueError
        As the protocol says.
    """
    particles = weighted("Gaussian extraction", points, weights, circular)
    return of_moments(particles.moments(), particles.circular)
