"""What the landmark models share: the map, the likelihood of a direction, and the sum over the map.

Where nobody says which landmark was seen, the association c is a nuisance, and is marginalised (chapters 6 and 7 of
*Probabilistic Robotics*; there the most likely one is taken)::

    p(z | x) = (1 - outliers) Σ_c p(c) p(z | x, c) + outliers / volume,   p(c) = 1 / number of landmarks

A particle is then judged by every landmark that could explain the reading, and none by an association that turns out
to be wrong.

Sights of one thing that follow each other repeat its errors: what hides a part of a landmark, or a robot that stands
where none is, is there in the next picture, too. A sight that is worth only a share s of an independent one weighs
by p(z | x)^s. A larger sigma would come to the same for one Gaussian, but would take what is no landmark for one, and
one landmark for its neighbour.
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


class Tempered:
    """Where a log likelihood is added up, and a ``share`` of it is taken: the log weights themselves, if that is 1."""

    __slots__ = ("_block", "_particles", "_share", "log_weights")

    def __init__(self, particles: ParticleSet, first: int, last: int, share: float) -> None:
        self._particles, self._block, self._share = particles, slice(first, last), share
        self.log_weights = particles.log_weights if share == 1.0 else np.zeros(last, np.float32)

    def take(self) -> None:
        """Add the share of what was added up to the particles' log weights."""
        if self._share != 1.0:
            self._particles.log_weights[self._block] += (
                np.float32(self._share) * self.log_weights[self._block]
            )


def share_refusal(share: float) -> str | None:
    """Why a sight cannot be used that says to be worth such a share."""
    return None if 0.0 < share <= 1.0 else f"share must be in (0, 1], got {share}"


class Sight:
    """One reading of a landmark, in the kernels' terms: the distance (gain 0 where there is none) and the bearing."""

    __slots__ = ("bearing", "concentration", "distance", "gain")

    def __init__(self, distance: float, sigma_distance: float, bearing: float, sigma_bearing: float) -> None:
        self.distance = distance
        self.gain = 0.0 if math.isinf(sigma_distance) else math.sqrt(0.5) / sigma_distance
        self.bearing = math.remainder(bearing, CIRCLE)
        self.concentration = 1.0 / (sigma_bearing * sigma_bearing)

    def of(
        self,
        north: float,
        east: float,
        particles: ParticleSet,
        first: int,
        last: int,
        mixed: Mixture,
        share: float = 1.0,
    ) -> None:
        """Weigh particles by the landmark at (north, east), by a ``share`` of what an independent sight says."""
        tempered = Tempered(particles, first, last, share)
        sighted.direct(
            particles.columns,
            tempered.log_weights,
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
        tempered.take()

    def of_any(
        self,
        landmarks: Float32Array,
        particles: ParticleSet,
        first: int,
        last: int,
        mixed: Mixture,
        share: float = 1.0,
    ) -> None:
        """Weigh particles by all ``landmarks``, any of which it may be, by a ``share`` of an independent sight."""
        scratch = np.empty((3, last), np.float32)
        inlier = math.exp(mixed.log_inlier) / landmarks.shape[0]
        outlier = max(math.exp(max(mixed.log_outlier, -700.0)), LEAST)
        face.direct(particles.columns, first, last, self.bearing, scratch)
        among.direct(
            particles.columns, first, last, landmarks, self.distance, self.gain, self.concentration, scratch
        )
        tempered = Tempered(particles, first, last, share)
        gather.direct(tempered.log_weights, first, last, scratch, inlier, outlier)
        tempered.take()


def likeliest(landmarks: Float32Array, pose: tuple[float, float, float], sight: Sight) -> tuple[float, float]:
    """Return where the landmark stands that a reading from ``pose`` (north, east, heading) fits best."""
    north, east = landmarks[:, 0] - pose[0], landmarks[:, 1] - pose[1]
    away = np.hypot(north, east)
    turned = 1.0 - np.cos(np.arctan2(east, north) - pose[2] - sight.bearing)
    surprise = np.square(sight.gain * (sight.distance - away)) + sight.concentration * turned
    best = int(np.argmin(surprise))
    return float(landmarks[best, 0]), float(landmarks[best, 1])
