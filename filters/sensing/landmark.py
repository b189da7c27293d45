"""What the landmark models share: the map, the likelihood of a direction, and the sum over the map.

Where nobody says which landmark was seen, the association c is a nuisance, and is marginalised (chapters 6 and 7 of
*Probabilistic Robotics*; there the most likely one is taken)::

    p(z | x) = (1 - outliers) Σ_c p(c) p(z | x, c) + outliers / volume,   p(c) = 1 / number of landmarks

A particle is then judged by every landmark that could explain the reading, and none by an association that turns out
to be wrong.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from filters.kernels.compile import Float32Array
from filters.kernels.landmarks import among, face, gather, sighted
from filters.particle_set import ParticleSet
from filters.sensing.robust import Mixture

CIRCLE = 2.0 * math.pi
_LARGE = 50.0
LEAST = 1e-30
"""Likelihood, relative to the peak, that is left where no landmark explains a reading and there is no outlier part."""


@lru_cache(maxsize=1024)
def log_von_mises_peak(sigma: float) -> float:
    """Return the log density of von Mises at its peak, with the concentration 1 / sigma²: -log(2π I₀(κ) exp(-κ)).

    Above a concentration of 50, I₀ is its asymptotic series to the fourth term (relative error 2e-7).
    """
    concentration = 1.0 / (sigma * sigma)
    if concentration <= _LARGE:
        return concentration - math.log(CIRCLE * float(np.i0(concentration)))
    x = 1.0 / (8.0 * concentration)
    series = 1.0 + x * (1.0 + x * (4.5 + x * 37.5))
    return -math.log(CIRCLE) + 0.5 * math.log(CIRCLE * concentration) - math.log(series)


def checked(sensor: str, landmarks: ArrayLike | None) -> Float32Array:
    """Return a map as float32 (landmark, 2), north and east; no rows for ``None``.

    Raises
    ------
    ValueError
        It is not of that shape, or not finite.
    """
    if landmarks is None:
        return np.zeros((0, 2), np.float32)
    table = np.ascontiguousarray(landmarks, np.float32)
    if table.ndim != 2 or table.shape[1] != 2 or not np.isfinite(table).all():
        raise ValueError(f"{sensor}: landmarks are rows of two finite numbers (north, east)")
    return table


def check_association(sensor: str, known: bool, landmarks: Float32Array) -> str | None:
    """Return why a reading of a landmark that nobody named cannot be used, if so."""
    if known or landmarks.shape[0]:
        return None
    return f"{sensor}: a landmark that is not named needs a map to look for it in"


class Sight:
    """One reading of a landmark, in the kernels' terms: the distance (gain 0 where there is none) and the bearing."""

    __slots__ = ("bearing", "concentration", "distance", "gain")

    def __init__(self, distance: float, sigma_distance: float, bearing: float, sigma_bearing: float) -> None:
        self.distance = distance
        self.gain = 0.0 if math.isinf(sigma_distance) else math.sqrt(0.5) / sigma_distance
        self.bearing = math.remainder(bearing, CIRCLE)
        self.concentration = 1.0 / (sigma_bearing * sigma_bearing)

    def of(
        self, north: float, east: float, particles: ParticleSet, first: int, last: int, mixed: Mixture
    ) -> None:
        """Weigh particles by the landmark at (north, east)."""
        columns, log_weights = particles.columns, particles.log_weights
        sighted.direct(
            columns,
            log_weights,
            first,
            last,
            north,
            east,
            self.distance,
            self.gain,
            self.bearing,
            self.concentration,
            mixed.log_inlier,
            mixed.log_outlier,
        )

    def of_any(
        self, landmarks: Float32Array, particles: ParticleSet, first: int, last: int, mixed: Mixture
    ) -> None:
        """Weigh particles by all ``landmarks``, any of which it may be."""
        scratch = np.empty((3, last), np.float32)
        inlier = math.exp(mixed.log_inlier) / landmarks.shape[0]
        outlier = max(math.exp(max(mixed.log_outlier, -700.0)), LEAST)
        face.direct(particles.columns, first, last, self.bearing, scratch)
        among.direct(
            particles.columns, first, last, landmarks, self.distance, self.gain, self.concentration, scratch
        )
        gather.direct(particles.log_weights, first, last, scratch, inlier, outlier)


def likeliest(landmarks: Float32Array, pose: tuple[float, float, float], sight: Sight) -> tuple[float, float]:
    """Return where the landmark stands that a reading from ``pose`` (north, east, heading) fits best."""
    north, east = landmarks[:, 0] - pose[0], landmarks[:, 1] - pose[1]
    away = np.hypot(north, east)
    turned = 1.0 - np.cos(np.arctan2(east, north) - pose[2] - sight.bearing)
    surprise = np.square(sight.gain * (sight.distance - away)) + sight.concentration * turned
    best = int(np.argmin(surprise))
    return float(landmarks[best, 0]), float(landmarks[best, 1])
