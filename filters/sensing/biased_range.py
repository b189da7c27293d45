"""Range with a bias for every beacon, marginalised, an NLOS tail, and the vehicle's height where it is a state.

    expected = scale · sqrt((north - n)² + (east - e)² + (down - d)²) + bias of the beacon

Given a particle's path the bias is linear and Gaussian, so it is not sampled but *marginalised* (Schön, Gustafsson,
Nordlund 2005; as gyro bias and odometry scale in :mod:`filters.motion.unicycle`). A particle carries its mean m of each
beacon's bias; the variance P is common to all. With r the measured less the expected range by m, S = P + sigma², and
the parts of the beam model of chapter 6 of *Probabilistic Robotics* (6.3: a hit, something in between, a random
measurement), turned about because what radio meets on its way makes a range longer, not shorter::

    p(z | x) = hit N(r; 0, S) + nlos [r > 0] exp(-r / length) / length + outliers / span
    q = share of the first part in it,   m += q P / S r,   P -= q̄ P² / S

The mean moves by as much as the reading is a hit, particle by particle (probabilistic data association; Bar-Shalom,
Fortmann 1988); the variance by the q̄ of all.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from numpy import float32

from filters.kernels.compile import Float32Array, kernel
from filters.kernels.elementary import exp, log_mixture
from filters.particle_set import ParticleSet
from filters.sensing.robust import NEVER, check, sigma_refusal

_LOG_SQRT_TWO_PI = 0.5 * math.log(2.0 * math.pi)


class BiasedRangeMeasurement(NamedTuple):
    """A range, and which beacon it is to.

    Attributes
    ----------
    distance : float
        Measured, metres.
    north, east : float
        Of the beacon, metres.
    down_difference : float
        The beacon's down less the vehicle's, or less zero where the vehicle's down is a state; metres.
    sigma : float or None
        Standard deviation of this measurement, metres, if it says so.
    beacon : int or None
        Its number, by which its bias is found.
    """

    distance: float
    north: float
    east: float
    down_difference: float = 0.0
    sigma: float | None = None
    beacon: int | None = None


class _Parts(NamedTuple):
    """One measurement, ready for the kernel: log densities less the largest that they can have together."""

    gain: float
    log_hit: float
    log_outlier: float
    log_nlos: float
    log_peak: float
    teach: float


class BiasedRange:
    """Range with a bias per beacon, marginalised.

    Parameters
    ----------
    sigma : float
        Standard deviation, metres, of measurements that do not state their own.
    outliers : float
        Fraction of measurements that say nothing.
    span : float
        How widely outliers scatter, metres.
    scale : str, optional
        Slow state to multiply the distance by.
    biases : mapping of int to str, optional
        The slow state of each beacon's bias, by the beacon's number; the others have none.
    nlos : float
        Fraction of measurements that are too long because the direct way was blocked.
    nlos_length : float
        By how much those are too long on average, metres.
    height : str, optional
        The state of the vehicle's down, if there is one.
    longest : float
        Farthest that the sensor can measure, metres; a longer distance is refused.

    Raises
    ------
    ValueError
        A parameter out of its range.
    """

    def __init__(
        self,
        sigma: float,
        outliers: float = 0.05,
        span: float = 200.0,
        scale: str | None = None,
        biases: Mapping[int, str] | None = None,
        nlos: float = 0.0,
        nlos_length: float = 1.0,
        height: str | None = None,
        longest: float = 100_000.0,
    ) -> None:
        check("range", sigma, outliers, span)
        for name, value in (("longest", longest), ("nlos_length", nlos_length)):
            if not 0.0 < value < math.inf:
                raise ValueError(f"range: {name} must be positive and finite, got {value}")
        if not 0.0 <= nlos < 1.0 - outliers:
            raise ValueError(f"range: nlos is a fraction in [0, {1.0 - outliers:g}), got {nlos}")
        self.sigma = sigma
        self.outliers = outliers
        self.span = span
        self.scale = scale
        self.biases: Mapping[int, str] = biases or {}
        self.nlos = nlos
        self.nlos_length = nlos_length
        self.height = height
        self.longest = longest

    def refusal(self, measurement: BiasedRangeMeasurement) -> str | None:
        """Refuse a distance not positive or longer than ``longest``, and a sigma that is not positive."""
        if not 0.0 < measurement.distance <= self.longest:
            return f"distance must lie in (0, {self.longest:g}] m, got {measurement.distance:g}"
        return sigma_refusal(measurement.sigma)

    def bias_of(self, measurement: BiasedRangeMeasurement) -> str | None:
        """Return the name of the bias of the beacon measured to, if it has one."""
        return None if measurement.beacon is None else self.biases.get(measurement.beacon)

    def weigh(
        self, particles: ParticleSet, first: int, last: int, measurement: BiasedRangeMeasurement
    ) -> float:
        """Add the log likelihood of a range and teach the means of its bias; see :class:`filters.sensing.Sensor`."""
        distance, north, east, down, _, _ = measurement
        bias = self.bias_of(measurement)
        parts = self._parts(measurement, 0.0 if bias is None else particles.variances.get(bias, 0.0))
        scale_row, scale_slope = (0, 0.0) if self.scale is None else (particles.row(self.scale), 1.0)
        bias_row, bias_slope = (0, 0.0) if bias is None else (particles.row(bias), 1.0)
        down_row, down_slope = (0, 0.0) if self.height is None else (particles.row(self.height), 1.0)
        reach.direct(
            particles.columns,
            particles.log_weights,
            first,
            last,
            north,
            east,
            down,
            distance,
            parts.gain,
            parts.log_hit,
            parts.log_outlier,
            parts.log_nlos,
            1.0 / self.nlos_length,
            scale_row,
            scale_slope,
            bias_row,
            bias_slope,
            down_row,
            down_slope,
            parts.teach,
        )
        return parts.log_peak

    def learn(self, particles: ParticleSet, measurement: BiasedRangeMeasurement, log_mean: float) -> None:
        """Take what the particles learned of the bias off its variance; see :class:`filters.sensing.model.Learner`."""
        bias = self.bias_of(measurement)
        if bias is None or bias not in particles.variances:
            return
        variance = particles.variances[bias]
        noise = self._sigma(measurement) ** 2
        density = self.outliers / self.span + self.nlos / self.nlos_length
        hit = max(0.0, 1.0 - density * math.exp(min(700.0, -log_mean))) if log_mean > -math.inf else 0.0
        particles.variances[bias] = variance * (1.0 - hit * variance / (variance + noise))

    def innovation(self, centre: Mapping[str, float], measurement: BiasedRangeMeasurement) -> float:
        """Measured less expected distance at the centre, metres."""
        down = measurement.down_difference - (0.0 if self.height is None else centre[self.height])
        expected = math.hypot(centre["north"] - measurement.north, centre["east"] - measurement.east, down)
        if self.scale is not None:
            expected *= centre[self.scale]
        bias = self.bias_of(measurement)
        return measurement.distance - expected - (0.0 if bias is None else centre[bias])

    def _sigma(self, measurement: BiasedRangeMeasurement) -> float:
        return self.sigma if measurement.sigma is None else measurement.sigma

    def _parts(self, measurement: BiasedRangeMeasurement, variance: float) -> _Parts:
        total = variance + self._sigma(measurement) ** 2
        share = 1.0 - self.outliers - self.nlos
        parts = (
            math.log(share) - 0.5 * math.log(total) - _LOG_SQRT_TWO_PI,
            _log(self.outliers / self.span),
            _log(self.nlos / self.nlos_length),
        )
        top = max(parts)
        peak = top + math.log(math.fsum(math.exp(part - top) for part in parts if part > NEVER))
        hit, outlier, nlos = (part - peak if part > NEVER else NEVER for part in parts)
        return _Parts(math.sqrt(0.5 / total), hit, outlier, nlos, peak, variance / total)


def _log(density: float) -> float:
    return math.log(density) if density > 0.0 else NEVER


@kernel(
    "void(float32[:, ::1], float32[::1], int64, int64, float32, float32, float32, float32, float32, float32,"
    "float32, float32, float32, int64, float32, int64, float32, int64, float32, float32)"
)
def reach(
    columns: Float32Array,
    log_weights: Float32Array,
    first: int,
    last: int,
    beacon_north: float,
    beacon_east: float,
    beacon_down: float,
    distance: float,
    gain: float,
    log_hit: float,
    log_outlier: float,
    log_nlos: float,
    per_length: float,
    scale_row: int,
    scale_slope: float,
    bias_row: int,
    bias_slope: float,
    down_row: int,
    down_slope: float,
    teach: float,
) -> None:
    """Add the log of the three parts; a state that is not there has slope 0, and a bias without one stands still."""
    north = columns[0, first:last]
    east = columns[1, first:last]
    scale = columns[scale_row, first:last]
    bias = columns[bias_row, first:last]
    down = columns[down_row, first:last]
    log_weight = log_weights[first:last]
    lesson = float32(teach * bias_slope)
    for i in range(last - first):
        n = float32(north[i] - beacon_north)
        e = float32(east[i] - beacon_east)
        d = float32(down_slope * down[i] - beacon_down)
        factor = float32(scale_slope * scale[i] + float32(float32(1.0) - scale_slope))
        expected = float32(factor * float32(math.sqrt(float32(n * n + e * e + d * d))) + bias_slope * bias[i])
        r = float32(distance - expected)
        q = float32(gain * r)
        square = float32(q * q)
        late = float32(r * per_length) if r > float32(0.0) else float32(1e30)
        other = log_mixture(late, log_nlos, log_outlier)
        both = log_mixture(square, log_hit, other)
        log_weight[i] += both
        hit = exp(float32(min(float32(log_hit - square - both), float32(0.0))))
        bias[i] += float32(lesson * float32(hit * r))
