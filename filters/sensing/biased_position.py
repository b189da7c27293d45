"""Position of a receiver whose error lasts: a part of it is a state, marginalised, and only the rest is new every time.

A satellite receiver's fixes lie metres off for minutes, and agree with each other to decimetres. So they tell much
better how a vehicle moved than where it is. With b the part that lasts (a Gauss-Markov process of variance B per axis,
which decays with T) and w the part that does not::

    z = (north, east) + b + w,     b(t + d) = a b(t) + sqrt(1 - a²) N(0, B),     a = exp(-d / T)

Given a particle's path, b is linear and Gaussian: a particle carries its mean m, one number per axis, and all share the
variance P (Schön, Gustafsson, Nordlund, "Marginalized particle filters for mixed linear/nonlinear state-space models",
IEEE TSP 53(7), 2005). With r the measured less the expected position by m, and S = P + sigma² on each axis::

    p(z | x) = (1 - outliers) N(r; 0, S I) + outliers / span²
    q = share of the first part in it,   m += q P / S r,   P -= q̄ P² / S

as :mod:`filters.sensing.learned_bias` has it in one dimension.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from numpy import float32

from filters.kernels.compile import Float32Array, kernel
from filters.kernels.elementary import exp, log_mixture, sincos
from filters.particle_set import ParticleSet
from filters.sensing.position import Position, PositionMeasurement
from filters.sensing.robust import Mixture, mixture, sigma_refusal

_LOG_TWO_PI = math.log(2.0 * math.pi)


class Bias(NamedTuple):
    """Names of the two states that are a receiver's lasting error, metres north and east."""

    north: str
    east: str


class BiasedPosition:
    """A position with a lasting error, isotropic, and an outlier part.

    Parameters
    ----------
    plain : Position
        Whose outliers, span, lever and delay are used.
    bias : Bias
        Learned states (:class:`filters.motion.learned.Learned`) of one variance. That they decay is seen to by
        :func:`fade`.
    """

    def __init__(self, plain: Position, bias: Bias) -> None:
        self.plain = plain
        self.bias = bias

    def refusal(self, measurement: PositionMeasurement) -> str | None:
        """Refuse a sigma that is not positive."""
        return sigma_refusal(measurement.sigma_north)

    def weigh(self, particles: ParticleSet, first: int, last: int, measurement: PositionMeasurement) -> float:
        """Add the log likelihood and teach the means of the bias; see :class:`filters.sensing.Sensor`.

        ``sigma_north`` is that of the part that does not last, on both axes.
        """
        plain = self.plain
        variance, total = self._variances(particles, measurement)
        mixed = self._mixture(total)
        delayed = plain.delay is not None
        biased_fix.direct(
            particles.columns,
            particles.log_weights,
            first,
            last,
            particles.row(self.bias.north),
            particles.row(self.bias.east),
            0 if plain.delay is None else particles.row(plain.delay),
            measurement.speed if delayed else 0.0,
            measurement.yaw_rate if delayed else 0.0,
            measurement.north,
            measurement.east,
            math.sqrt(0.5 / total),
            plain.lever[0],
            plain.lever[1],
            mixed.log_inlier,
            mixed.log_outlier,
            variance / total,
        )
        return mixed.log_peak

    def learn(self, particles: ParticleSet, measurement: PositionMeasurement, log_mean: float) -> None:
        """Take what was learned of the bias off its variance; see :class:`filters.sensing.model.Learner`."""
        variance, total = self._variances(particles, measurement)
        density = self.plain.outliers / self.plain.span**2
        wild = density * math.exp(min(700.0, -log_mean)) if log_mean > -math.inf else 1.0
        left = variance * (1.0 - max(0.0, 1.0 - wild) * variance / total)
        for name in self.bias:
            particles.variances[name] = left

    def innovation(self, centre: Mapping[str, float], measurement: PositionMeasurement) -> float:
        """Distance between measured and expected position at the centre, metres."""
        value = measurement._replace(
            north=measurement.north - centre[self.bias.north], east=measurement.east - centre[self.bias.east]
        )
        return self.plain.innovation(centre, value)

    def _variances(self, particles: ParticleSet, measurement: PositionMeasurement) -> tuple[float, float]:
        """Return P and S."""
        sigma = self.plain.sigma if measurement.sigma_north is None else measurement.sigma_north
        variance = particles.variances[self.bias.north]
        return variance, variance + sigma * sigma

    def _mixture(self, total: float) -> Mixture:
        return mixture(self.plain.outliers, -_LOG_TWO_PI - math.log(total), -2.0 * math.log(self.plain.span))


@kernel(
    "void(float32[:, ::1], float32[::1], int64, int64, int64, int64, int64, float32, float32, float32, float32,"
    "float32, float32, float32, float32, float32, float32)"
)
def biased_fix(
    columns: Float32Array,
    log_weights: Float32Array,
    first: int,
    last: int,
    north_row: int,
    east_row: int,
    delay_row: int,
    speed: float,
    yaw_rate: float,
    measured_north: float,
    measured_east: float,
    gain: float,
    forward: float,
    right: float,
    log_inlier: float,
    log_outlier: float,
    teach: float,
) -> None:
    """Add the log of the mixture at the antenna's place, and move the bias by the inlier's share of the residual."""
    north = columns[0, first:last]
    east = columns[1, first:last]
    heading = columns[2, first:last]
    delay = columns[delay_row, first:last]
    bias_north = columns[north_row, first:last]
    bias_east = columns[east_row, first:last]
    log_weight = log_weights[first:last]
    for i in range(last - first):
        d = delay[i]
        s, c = sincos(float32(heading[i] - float32(0.5) * float32(yaw_rate * d)))
        ahead = float32(forward - float32(speed * d))
        n = float32(measured_north - north[i] - ahead * c + right * s - bias_north[i])
        e = float32(measured_east - east[i] - ahead * s - right * c - bias_east[i])
        square = float32(float32(gain * gain) * float32(n * n + e * e))
        both = log_mixture(square, log_inlier, log_outlier)
        log_weight[i] += both
        inlier = float32(teach * exp(float32(min(float32(log_inlier - square - both), float32(0.0)))))
        bias_north[i] += float32(inlier * n)
        bias_east[i] += float32(inlier * e)
