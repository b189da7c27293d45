"""Range: the distance to a beacon whose place is known.

    expected = scale · sqrt((north - n)² + (east - e)² + d²) + bias

with (n, e) the beacon's place, d its difference in height, and scale and bias slow states if named. With the
outlier part, as the range part of the beam and landmark models of chapter 6 of *Probabilistic Robotics*.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from numpy import float32

from filters.kernels.compile import Float32Array, function, kernel
from filters.kernels.elementary import Real, log_mixture
from filters.kernels.evidence import CHUNK, thin
from filters.kernels.weights import peak
from filters.particle_set import ParticleSet
from filters.sensing.model import Account, Float64Array
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
        self._own = self._constants(sigma)

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

    def tabulate(self, measurements: Sequence[RangeMeasurement]) -> list[float] | None:
        """Prepare several ranges for one call; see :class:`filters.sensing.model.Batch`."""
        longest, own = self.longest, self._own
        numbers: list[float] = []
        for distance, north, east, down, sigma in measurements:
            if not 0.0 < distance <= longest or (sigma is not None and not sigma > 0.0):
                return None
            numbers += (distance, north, east, down)
            numbers += own if sigma is None else self._constants(sigma)
        return numbers

    def weigh_all(
        self, particles: ParticleSet, first: int, last: int, numbers: Float64Array, account: Account
    ) -> float:
        """Add the log likelihoods of several ranges in turn; see :class:`filters.sensing.model.Batch`."""
        columns, log_weights = particles.columns, particles.log_weights
        if self._plain:
            return gaussian_all.direct(columns, log_weights, first, last, numbers, *account)
        scale_row, scale_slope = (0, 0.0) if self.scale is None else (particles.row(self.scale), 1.0)
        bias_row, bias_slope = (0, 0.0) if self.bias is None else (particles.row(self.bias), 1.0)
        slow = (scale_row, scale_slope, bias_row, bias_slope)
        return robust_all.direct(columns, log_weights, first, last, numbers, *account, *slow)

    def _constants(self, sigma: float) -> tuple[float, float, float, float]:
        """Return what the kernels want to know of a standard deviation: the gain, and the three of the mixture."""
        log_density = -math.log(sigma) - _LOG_SQRT_TWO_PI
        mixed = mixture(self.outliers, log_density, -math.log(self.span))
        return _ROOT_HALF / sigma, mixed.log_inlier, mixed.log_outlier, mixed.log_peak

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
    beacon_north: Real,
    beacon_east: Real,
    down_square: Real,
    distance: Real,
    gain: Real,
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
    beacon_north: Real,
    beacon_east: Real,
    down_square: Real,
    distance: Real,
    gain: Real,
    log_inlier: Real,
    log_outlier: Real,
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


@function
def away(centre: Float32Array, numbers: Float64Array) -> float:
    """Distance of a beacon from the centre."""
    north = centre[0, 0] - numbers[1]
    east = centre[1, 0] - numbers[2]
    return math.sqrt(north * north + east * east + numbers[3] * numbers[3])


@kernel(
    "float64(float32[:, ::1], float32[::1], int64, int64, float64[:, ::1], int64, float32[:, ::1], int64,"
    "float32[:, ::1], float64[:, ::1])"
)
def gaussian_all(
    columns: Float32Array,
    log_weights: Float32Array,
    first: int,
    last: int,
    numbers: Float64Array,
    rows: int,
    centre: Float32Array,
    stride: int,
    samples: Float32Array,
    said: Float64Array,
) -> float:
    """Do what :func:`gaussian` does for several ranges, a row of numbers each, and keep a sample after every one."""
    for start in range(first, last, CHUNK):
        end = min(start + CHUNK, last)
        for k in range(rows):
            n = numbers[k]
            gaussian(
                columns,
                log_weights,
                start,
                end,
                float32(n[1]),
                float32(n[2]),
                float32(n[3] * n[3]),
                float32(n[0]),
                float32(n[4]),
            )
            thin(log_weights, start, end, stride, samples[k])
    for k in range(rows):
        said[k, 0] = numbers[k, 7]
        said[k, 1] = numbers[k, 0] - away(centre, numbers[k])
    return peak(log_weights, first, last)


@kernel(
    "float64(float32[:, ::1], float32[::1], int64, int64, float64[:, ::1], int64, float32[:, ::1], int64,"
    "float32[:, ::1], float64[:, ::1], int64, float32, int64, float32)"
)
def robust_all(
    columns: Float32Array,
    log_weights: Float32Array,
    first: int,
    last: int,
    numbers: Float64Array,
    rows: int,
    centre: Float32Array,
    stride: int,
    samples: Float32Array,
    said: Float64Array,
    scale_row: int,
    scale_slope: float,
    bias_row: int,
    bias_slope: float,
) -> float:
    """Do what :func:`robust` does for several ranges, a row of numbers each, and keep a sample after every one."""
    for start in range(first, last, CHUNK):
        end = min(start + CHUNK, last)
        for k in range(rows):
            n = numbers[k]
            robust(
                columns,
                log_weights,
                start,
                end,
                float32(n[1]),
                float32(n[2]),
                float32(n[3] * n[3]),
                float32(n[0]),
                float32(n[4]),
                float32(n[5]),
                float32(n[6]),
                scale_row,
                scale_slope,
                bias_row,
                bias_slope,
            )
            thin(log_weights, start, end, stride, samples[k])
    factor = scale_slope * centre[scale_row, 0] + (1.0 - scale_slope)
    for k in range(rows):
        said[k, 0] = numbers[k, 7]
        said[k, 1] = numbers[k, 0] - factor * away(centre, numbers[k]) - bias_slope * centre[bias_row, 0]
    return peak(log_weights, first, last)
