"""A weighted particle set as the extractors take it: checked, weights that sum to one, angles wrapped."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from filters.density import circular as angles
from filters.density.circular import Flags
from filters.density.protocol import Array, DensityMoments


class Weighted(NamedTuple):
    """Particles (count, d), weights (count,) that sum to one, and which dimensions wrap (d,)."""

    points: Array
    weights: Array
    circular: Flags

    @property
    def effective_sample_size(self) -> float:
        """1 / Σ w², equation 4.36's gathered variance turned round."""
        return float(1.0 / np.square(self.weights).sum())

    def moments(self) -> DensityMoments:
        """Return weighted mean and covariance; of angles the mean direction and wrapped differences."""
        centre = angles.mean(self.points, self.weights, self.circular)
        away = angles.difference(self.points, centre, self.circular)
        return DensityMoments(centre, (away * self.weights[:, None]).T @ away)


def weighted(
    where: str, points: ArrayLike, weights: ArrayLike | None, circular: Sequence[bool] | None
) -> Weighted:
    """Check a particle set; ``where`` says in an error who was asked.

    Raises
    ------
    ValueError
        As :class:`filters.density.protocol.Extractor` says.
    """
    particles = np.asarray(points, np.float64)
    if particles.ndim != 2 or 0 in particles.shape:
        raise ValueError(f"{where}: points must be (count, d), neither zero, got {particles.shape}")
    count, size = particles.shape
    given = np.ones(count) if weights is None else np.asarray(weights, np.float64)
    flags = np.zeros(size, np.bool_) if circular is None else np.asarray(circular, np.bool_)
    if given.shape != (count,) or flags.shape != (size,):
        raise ValueError(
            f"{where}: {count} points of {size} dimensions need weights ({count},) and circular ({size},), "
            f"got {given.shape} and {flags.shape}"
        )
    total = float(given.sum())
    if not np.isfinite(particles).all() or not (given >= 0.0).all() or not 0.0 < total < np.inf:
        raise ValueError(
            f"{where}: points must be finite, weights not negative with a positive finite sum, got a sum of {total}"
        )
    return Weighted(angles.wrap_columns(particles, flags), given / total, flags)


def asked(where: str, points: ArrayLike, size: int) -> Array:
    """Check the points at which a density of ``size`` dimensions is asked for.

    Raises
    ------
    ValueError
        A shape other than (count, size), or numbers that are not finite.
    """
    given = np.asarray(points, np.float64)
    if given.ndim != 2 or given.shape[1] != size or not np.isfinite(given).all():
        raise ValueError(f"{where}: points must be finite and (count, {size}), got {given.shape}")
    return given
