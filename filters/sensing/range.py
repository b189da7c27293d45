"""Range: the distance to a beacon whose place is known.

    expected = scale · sqrt((north - n)² + (east - e)² + d²) + bias

with (n, e) the beacon's place, d its difference in height, and scale and bias slow states if named. With the
outlier part, as the range part of the beam and landmark models of chapter 6 of *Probabilistic Robotics*.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from numpy import float32

from filters.kernels.compile import Float32Array, kernel
from filters.kernels.elementary import log_mixture
from filters.particle_set import ParticleSet
from filters.sensing.robust import check, mixture, sigma_refusal

_LOG_SQRT_TWO_PI = 0.5 * math.log(2.0 * math.pi)
_ROOT_HALF = math.sqrt(0.5)


class RangeMeasurement(NamedTuple):
    """A range, and where its beacon stands.

    Attributes
    ----------
    distance : float
        Measured, metres.
    north, east : float
        Of the beacon, metres.
    down_difference : float
        The beacon's down less the vehicle's, metres.
    sigma : float or None
        Standard deviation of this measurement, metres, if it says so.
    """

    distance: float
    north: float
    east: float
    down_difference: float = 0.0
    sigma: float | None = None


class Range:
    """Gaussian range with an outlier part uniform over ``span`` metres.

    Parameters
    ----------
    sigma : float
        Standard deviation, metres, of measurements that do not state their own.
    outliers : float
        Fraction of measurements that say nothing; 0 for a pure Gaussian.
    span : float
        How widely outliers scatter, metres.
    longest : float
        Farthest that the sensor can measure, metres; a longer distance is refused.
    scale, bias : str, optional
        Slow states to multiply the distance by, and to add to it.

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
        bias: str | None = None,
        longest: float = 100_000.0,
    ) -> None:
        check("range", sigma, outliers, span)
        if not 0.0 < longest < math.inf:
            raise ValueError(f"range: longest must be positive and finite, got {longest}")
        self.sigma = sigma
        self.outliers = outliers
        self.span = span
        self.longest = longest
        self.scale = scale
        self.bias = bias
        self._plain = outliers == 0.0 and scale is None and bias is None

    def refusal(self, measurement: RangeMeasurement) -> str | None:
        """Refuse a distance not positive or longer than ``longest``, and a sigma that is not positive."""
        distance, _, _, _, sigma = measurement
        if not 0.0 < distance <= self.longest:
            return f"distance must lie in (0, {self.longest:g}] m, got {distance:g}"
        return None if sigma is None else sigma_refusal(sigma)

    def weigh(self, particles: ParticleSet, first: int, last: int, measurement: RangeMeasurement) -> float:
        """Add the log likelihood of a range; see :class:`filters.sensing.Sensor`."""
        distance, north, east, down, sigma = measurement
        if sigma is None:
            sigma = self.sigma
        log_density = -math.log(sigma) - _LOG_SQRT_TWO_PI
        gain = _ROOT_HALF / sigma
        columns, log_weights = particles.columns, particles.log_weights
        if self._plain:
            gaussian.direct(columns, log_weights, first, last, north, east, down * down, distance, gain)
            return log_density
        mixed = mixture(self.outliers, log_density, -math.log(self.span))
        scale_row, scale_slope = (0, 0.0) if self.scale is None else (particles.row(self.scale), 1.0)
        bias_row, bias_slope = (0, 0.0) if self.bias is None else (particles.row(self.bias), 1.0)
        robust.direct(
            columns,
            log_weights,
            first,
            last,
            north,
            east,
            down * down,
            distance,
            gain,
            mixed.log_inlier,
            mixed.log_outlier,
            scale_row,
            scale_slope,
            bias_row,
            bias_slope,
        )
        return mixed.log_peak

    def innovation(self, centre: Mapping[str, float], measurement: RangeMeasurement) -> float:
        """Measured less expected distance at the centre, metres."""
        distance, north, east, down, _ = measurement
        expected = math.hypot(centre["north"] - north, centre["east"] - east, down)
        if self.scale is not None:
            expected *= centre[self.scale]
        if self.bias is not None:
            expected += centre[self.bias]
        return distance - expected


@kernel("void(float32[:, ::1], float32[::1], int64, int64, float32, float32, float32, float32, float32)")
def gaussian(
    columns: Float32Array,
    log_weights: Float32Array,
    first: int,
    last: int,
    beacon_north: float,
    beacon_east: float,
    down_square: float,
    distance: float,
    gain: float,
) -> None:
    """Take the squared, scaled residual off each log weight."""
    north = columns[0, first:last]
    east = columns[1, first:last]
    log_weight = log_weights[first:last]
    for i in range(last - first):
        n = float32(north[i] - beacon_north)
        e = float32(east[i] - beacon_east)
        q = float32(gain * float32(distance - float32(math.sqrt(float32(n * n + e * e + down_square)))))
        log_weight[i] -= q * q


@kernel(
    "void(float32[:, ::1], float32[::1], int64, int64, float32, float32, float32, float32, float32, float32,"
    "float32, int64, float32, int64, float32)"
)
def robust(
    columns: Float32Array,
    log_weights: Float32Array,
    first: int,
    last: int,
    beacon_north: float,
    beacon_east: float,
    down_square: float,
    distance: float,
    gain: float,
    log_inlier: float,
    log_outlier: float,
    scale_row: int,
    scale_slope: float,
    bias_row: int,
    bias_slope: float,
) -> None:
    """Add the log of the mixture; a state that is not there has slope 0: scale 1 and bias 0."""
    north = columns[0, first:last]
    east = columns[1, first:last]
    scale = columns[scale_row, first:last]
    bias = columns[bias_row, first:last]
    log_weight = log_weights[first:last]
    for i in range(last - first):
        n = float32(north[i] - beacon_north)
        e = float32(east[i] - beacon_east)
        factor = float32(scale_slope * scale[i] + float32(float32(1.0) - scale_slope))
        expected = float32(
            factor * float32(math.sqrt(float32(n * n + e * e + down_square))) + bias_slope * bias[i]
        )
        q = float32(gain * float32(distance - expected))
        log_weight[i] += log_mixture(float32(q * q), log_inlier, log_outlier)
