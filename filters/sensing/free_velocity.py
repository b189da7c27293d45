"""Velocity of a vehicle whose velocity is a state: a receiver's Doppler shifts beside a constant-velocity motion.

    expected = (velocity north, velocity east)

Given its path a particle has a mean of both, and a variance P of each that all particles share
(:mod:`filters.motion.constant_velocity`). It is weighed by N(z; mean, P + sigma²) and keeps its mean: the path has told
nearly all that there is to know, so what a particle could learn beside its weight is next to nothing, and the belief
errs on the wide side, by less than P. With the outlier part.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from numpy import float32

from filters.kernels.compile import Float32Array, kernel
from filters.kernels.elementary import log_mixture
from filters.motion.constant_velocity import VELOCITY_EAST, VELOCITY_NORTH
from filters.particle_set import ParticleSet
from filters.sensing.robust import check, mixture, sigma_refusal

_LOG_TWO_PI = math.log(2.0 * math.pi)


class FreeVelocityMeasurement(NamedTuple):
    """A horizontal velocity.

    Attributes
    ----------
    north, east : float
        Measured, m/s.
    sigma : float or None
        Standard deviation per axis, m/s, if the measurement says so.
    loose : float
        Variance of a particle's own velocity given its path, P, (m/s)².
    """

    north: float
    east: float
    sigma: float | None = None
    loose: float = 0.0


class FreeVelocity:
    """Gaussian velocity with an outlier part uniform over a square of side ``span``.

    Parameters
    ----------
    sigma : float
        Standard deviation per axis, m/s, of measurements that do not state their own.
    outliers : float
        Fraction of measurements that say nothing.
    span : float
        Side of the square that an outlier may fall in, m/s; a faster one than half of it is refused.

    Raises
    ------
    ValueError
        A parameter out of its range.
    """

    def __init__(self, sigma: float, outliers: float = 0.05, span: float = 100.0) -> None:
        check("velocity", sigma, outliers, span)
        self.sigma = sigma
        self.outliers = outliers
        self.span = span

    def refusal(self, measurement: FreeVelocityMeasurement) -> str | None:
        """Refuse a sigma that is not positive, a variance that is negative, and what is faster than half the span."""
        fastest = 0.5 * self.span
        if math.hypot(measurement.north, measurement.east) > fastest:
            return f"velocity must be below {fastest:g} m/s, got {measurement.north:g}, {measurement.east:g}"
        if measurement.loose < 0.0:
            return f"variance of the velocity must not be negative, got {measurement.loose:g}"
        return sigma_refusal(measurement.sigma)

    def weigh(
        self, particles: ParticleSet, first: int, last: int, measurement: FreeVelocityMeasurement
    ) -> float:
        """Add the log likelihood of a velocity; see :class:`filters.sensing.Sensor`."""
        sigma = self.sigma if measurement.sigma is None else measurement.sigma
        total = sigma * sigma + measurement.loose
        mixed = mixture(self.outliers, -_LOG_TWO_PI - math.log(total), -2.0 * math.log(self.span))
        doppler.direct(
            particles.columns,
            particles.log_weights,
            first,
            last,
            particles.row(VELOCITY_NORTH),
            particles.row(VELOCITY_EAST),
            measurement.north,
            measurement.east,
            math.sqrt(0.5 / total),
            mixed.log_inlier,
            mixed.log_outlier,
        )
        return mixed.log_peak

    def innovation(self, centre: Mapping[str, float], measurement: FreeVelocityMeasurement) -> float:
        """Length of the difference between measured and expected velocity at the centre, m/s."""
        return math.hypot(
            measurement.north - centre[VELOCITY_NORTH], measurement.east - centre[VELOCITY_EAST]
        )


@kernel(
    "void(float32[:, ::1], float32[::1], int64, int64, int64, int64, float32, float32, float32, float32, float32)"
)
def doppler(
    columns: Float32Array,
    log_weights: Float32Array,
    first: int,
    last: int,
    north_row: int,
    east_row: int,
    measured_north: float,
    measured_east: float,
    gain: float,
    log_inlier: float,
    log_outlier: float,
) -> None:
    """Add the log of the mixture at every particle's own velocity."""
    north = columns[north_row, first:last]
    east = columns[east_row, first:last]
    log_weight = log_weights[first:last]
    for i in range(last - first):
        n = float32(gain * float32(measured_north - north[i]))
        e = float32(gain * float32(measured_east - east[i]))
        log_weight[i] += log_mixture(float32(n * n + e * e), log_inlier, log_outlier)
