"""Heading: a compass, or a pair of antennas.

    expected = heading + bias

A normal distribution of the wrapped difference, which is what a wrapped normal comes to while sigma is well
below pi, with the outlier part uniform over the circle.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from numpy import float32

from filters.kernels.compile import Float32Array, kernel
from filters.kernels.elementary import log_mixture, wrapped
from filters.particle_set import ParticleSet
from filters.sensing.robust import check, mixture, sigma_refusal

_LOG_SQRT_TWO_PI = 0.5 * math.log(2.0 * math.pi)
_CIRCLE = 2.0 * math.pi


class HeadingMeasurement(NamedTuple):
    """A heading.

    Attributes
    ----------
    heading : float
        Radians clockwise from true north, any number of turns.
    sigma : float or None
        Standard deviation, radians, if the measurement says so.
    """

    heading: float
    sigma: float | None = None


class Heading:
    """Normal, wrapped heading with an outlier part uniform over the circle.

    Parameters
    ----------
    sigma : float
        Standard deviation, radians, of measurements that do not state their own.
    outliers : float
        Fraction of measurements that say nothing.
    bias : str, optional
        Slow state that is added to the heading.

    Raises
    ------
    ValueError
        A parameter out of its range.
    """

    def __init__(self, sigma: float, outliers: float = 0.05, bias: str | None = None) -> None:
        check("heading", sigma, outliers, _CIRCLE)
        self.sigma = sigma
        self.outliers = outliers
        self.bias = bias

    def refusal(self, measurement: HeadingMeasurement) -> str | None:
        """Refuse a sigma that is not positive."""
        return sigma_refusal(measurement.sigma)

    def weigh(self, particles: ParticleSet, first: int, last: int, measurement: HeadingMeasurement) -> float:
        """Add the log likelihood of a heading; see :class:`filters.sensing.Sensor`."""
        sigma = self.sigma if measurement.sigma is None else measurement.sigma
        mixed = mixture(self.outliers, -math.log(sigma) - _LOG_SQRT_TWO_PI, -math.log(_CIRCLE))
        bias_row, bias_slope = (0, 0.0) if self.bias is None else (particles.row(self.bias), 1.0)
        compass.direct(
            particles.columns,
            particles.log_weights,
            first,
            last,
            math.remainder(measurement.heading, _CIRCLE),
            math.sqrt(0.5) / sigma,
            bias_row,
            bias_slope,
            mixed.log_inlier,
            mixed.log_outlier,
        )
        return mixed.log_peak

    def innovation(self, centre: Mapping[str, float], measurement: HeadingMeasurement) -> float:
        """Measured less expected heading at the centre, radians in [-pi, pi]."""
        expected = centre["heading"] + (0.0 if self.bias is None else centre[self.bias])
        return math.remainder(measurement.heading - expected, _CIRCLE)


@kernel(
    "void(float32[:, ::1], float32[::1], int64, int64, float32, float32, int64, float32, float32, float32)"
)
def compass(
    columns: Float32Array,
    log_weights: Float32Array,
    first: int,
    last: int,
    measured: float,
    gain: float,
    bias_row: int,
    bias_slope: float,
    log_inlier: float,
    log_outlier: float,
) -> None:
    """Add the log of the mixture; without a bias its slope is 0."""
    heading = columns[2, first:last]
    bias = columns[bias_row, first:last]
    log_weight = log_weights[first:last]
    for i in range(last - first):
        q = float32(gain * wrapped(float32(measured - heading[i] - bias_slope * bias[i])))
        log_weight[i] += log_mixture(float32(q * q), log_inlier, log_outlier)
