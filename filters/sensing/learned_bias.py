"""A bias of one sensor, marginalised: what a particle's mean of it learns from a reading, and the common variance.

Given a particle's path the bias b is linear and Gaussian (Schön, Gustafsson, Nordlund, "Marginalized particle filters
for mixed linear/nonlinear state-space models", IEEE TSP 53(7), 2005). A particle carries its mean m; the variance P is
common to all. With r the measured less the expected reading by m, and S = P + sigma²::

    p(z | x) = (1 - outliers) N(r; 0, S) + outliers / span
    q = share of the first part in it,   m += q P / S r,   P -= q̄ P² / S

The mean moves by as much as the reading is no outlier, particle by particle (probabilistic data association; Bar-Shalom
and Fortmann 1988); the variance by the q̄ of all. Ranges have the same with a third part
(:mod:`filters.sensing.biased_range`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy import float32

from filters.kernels.compile import part
from filters.kernels.elementary import Real, exp, log_mixture
from filters.particle_set import ParticleSet
from filters.sensing.robust import mixture

NOT_READ = 1
"""Row that stands for a bias that is not there: none that a kernel reads, for a bias is written to, and a loop that
reads it by another name cannot run in vector registers."""

_LOG_SQRT_TWO_PI = 0.5 * math.log(2.0 * math.pi)


class Lesson(NamedTuple):
    """One measurement, ready for a kernel.

    Attributes
    ----------
    gain : float
        Makes of a residual the root of what is taken off the log density.
    log_inlier, log_outlier, log_peak : float
        Of :class:`filters.sensing.robust.Mixture`.
    row : int
        Of the bias.
    slope : float
        1 where there is a bias, else 0: then the row is some other state's and must not be touched.
    teach : float
        P / S, or 0 without a bias.
    """

    gain: float
    log_inlier: float
    log_outlier: float
    log_peak: float
    row: int
    slope: float
    teach: float


def lesson(particles: ParticleSet, bias: str | None, sigma: float, outliers: float, span: float) -> Lesson:
    """Prepare a measurement of standard deviation ``sigma`` for particles that have ``bias`` as a state.

    Raises
    ------
    KeyError
        The particle set has no such state.
    """
    variance = 0.0 if bias is None else particles.variances.get(bias, 0.0)
    total = variance + sigma * sigma
    mixed = mixture(outliers, -0.5 * math.log(total) - _LOG_SQRT_TWO_PI, -math.log(span))
    row, slope = (NOT_READ, 0.0) if bias is None else (particles.row(bias), 1.0)
    return Lesson(math.sqrt(0.5 / total), *mixed, row, slope, variance / total)


def learn(
    particles: ParticleSet, bias: str | None, sigma: float, outliers: float, span: float, log_mean: float
) -> None:
    """Take what all particles learned of ``bias`` off its variance, by a measurement of log evidence ``log_mean``."""
    if bias is None or bias not in particles.variances:
        return
    variance = particles.variances[bias]
    wild = outliers / span * math.exp(min(700.0, -log_mean)) if log_mean > -math.inf else 1.0
    inlier = max(0.0, 1.0 - wild)
    particles.variances[bias] = variance * (1.0 - inlier * variance / (variance + sigma * sigma))


@part
def weighed(
    residual: np.float32, gain: Real, log_inlier: Real, log_outlier: Real, teach: Real
) -> tuple[np.float32, np.float32]:
    """Log density of a particle's residual, and how far it moves the mean of the bias, by the numbers of a lesson."""
    q = float32(gain * residual)
    square = float32(q * q)
    both = log_mixture(square, log_inlier, log_outlier)
    inlier = exp(float32(min(float32(log_inlier - square - both), float32(0.0))))
    return both, float32(teach * float32(inlier * residual))
