"""Weighted mean and covariance of a particle set, displaced, from one pass of sums about a reference.

Sums of squares run in single precision, so they are taken about a reference near the mean: the centre of the belief
as the last call found it, moved by the motion model since. Where that was not near enough (the belief has jumped, or
a heading wraps elsewhere about the mean than about the reference), the sums are taken once more.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from filters.belief import Displacement, Moments
from filters.kernels import weights
from filters.kernels.compile import Float32Array
from filters.particle_set import ParticleSet

FAR = 1e4
"""Square of the mean's distance from the reference over the variance; four digits of seven are lost."""

_POSE = 3


class MomentSums:
    """The sums, in memory allocated once.

    Parameters
    ----------
    particles : ParticleSet
        The set.
    particle_weights : (capacity,) float32
        Its weights.
    centre : ParticleSet
        One particle: the reference, and where the mean is left for the next call.
    """

    def __init__(self, particles: ParticleSet, particle_weights: Float32Array, centre: ParticleSet) -> None:
        self._particles = particles
        self._weights = particle_weights
        self._centre = centre
        self._sums = np.zeros(weights.SUMS + 2 * (len(particles.names) - _POSE))
        self._reference = np.zeros(_POSE, np.float32)

    def moments(
        self,
        shift: Displacement,
        bounds: list[tuple[int, int]],
        given_path: Mapping[str, float],
        effective_sample_size: float,
    ) -> Moments:
        """Return the moments of the particles, displaced each along its own heading, and move the centre to the mean.

        ``bounds`` are the blocks that are summed over in float32; ``given_path`` is what each marginalised column's
        variance is beyond the spread of its means.
        """
        centre: list[float] = self._centre.columns[:, 0].tolist()
        north, east, heading = self._displaced(centre, shift)
        sums, offset = self._sums_about(shift, bounds, north, east, heading)
        if abs(offset) > 1e-6 and sums[12] + abs(offset) >= 3.14:
            # some particle's difference wraps elsewhere about the mean than about the reference
            heading += offset
            sums, offset = self._sums_about(shift, bounds, north, east, heading)
        total = sums[0]
        n, e, h = sums[1] / total, sums[2] / total, sums[3] / total
        if n * n + e * e > FAR * (sums[6] / total - n * n + sums[8] / total - e * e):
            # the belief has jumped: single precision has no digits left for its spread about the old centre
            centre[0] += n
            centre[1] += e
            north, east, _ = self._displaced(centre, shift)
            sums, offset = self._sums_about(shift, bounds, north, east, heading)
            total = sums[0]
            n, e, h = sums[1] / total, sums[2] / total, sums[3] / total
        ne, nh, eh = sums[7] / total - n * e, sums[9] / total - n * h, sums[10] / total - e * h
        nn = max(sums[6] / total - n * n, 0.0)
        ee = max(sums[8] / total - e * e, 0.0)
        hh = max(sums[11] / total - 2.0 * offset * h + offset * offset, 0.0)
        ne = math.copysign(min(abs(ne), math.sqrt(nn * ee)), ne)  # rounding: few particles lie on a line
        slow: list[float] = []
        variance = [nn, ee, hh]
        for row, place in enumerate(range(weights.SUMS, len(sums), 2), _POSE):
            away = sums[place] / total
            slow.append(centre[row] + away)
            variance.append(max(sums[place + 1] / total - away * away, 0.0))
        for name, variance_given_path in given_path.items():
            variance[self._particles.rows[name]] += variance_given_path
        mean_heading = heading + offset
        self._centre.columns[:, 0] = (centre[0] + n, centre[1] + e, wrapped(mean_heading - shift.turn), *slow)
        return Moments(
            self._particles.names,
            np.array((north + n, east + e, wrapped(mean_heading), *slow)),
            np.array((nn, ne, nh, ne, ee, eh, nh, eh, hh)).reshape(3, 3),
            np.array(variance),
            effective_sample_size,
        )

    def _displaced(self, centre: list[float], shift: Displacement) -> list[float]:
        """Pose of the displaced centre, rounded to float32 as the kernel will see it."""
        north, east, heading, *_ = centre
        sine, cosine = math.sin(heading), math.cos(heading)
        self._reference[:] = (
            north + shift.forward * cosine - shift.right * sine,
            east + shift.forward * sine + shift.right * cosine,
            heading + shift.turn,
        )
        return self._reference.tolist()

    def _sums_about(
        self,
        shift: Displacement,
        bounds: list[tuple[int, int]],
        north: float,
        east: float,
        heading: float,
    ) -> tuple[list[float], float]:
        """Sums about a reference pose, and how far the circular mean lies from the reference heading."""
        sums = self._sums
        sums.fill(0.0)
        forward, right, turn = shift
        columns, weight, references = self._particles.columns, self._weights, self._centre.columns
        for first, last in bounds:
            weights.moments(columns, weight, first, last, forward, right, turn, north, east, heading, sums)
            weights.spread(columns, weight, first, last, references, sums)
        values: list[float] = sums.tolist()
        return values, math.atan2(values[4], values[5])


def wrapped(angle: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi
