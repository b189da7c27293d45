"""Down: a height, where the state has one.

    expected = down

Gaussian, with the outlier part uniform over ``span`` metres.
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


class DownMeasurement(NamedTuple):
    """A height, metres down from the origin, and its standard deviation, metres, if the measurement says so."""

    down: float
    sigma: float | None = None


class Down:
    """Gaussian height with an outlier part.

    Parameters
    ----------
    sigma : float
        Standard deviation, metres, of measurements that do not state their own.
    outliers : float
        Fraction of measurements that say nothing.
    span : float
        How widely outliers scatter, metres.

    Raises
    ------
    ValueError
        A parameter out of its range.
    """

    column = "down"

    def __init__(self, sigma: float = 3.0, outliers: float = 0.05, span: float = 1000.0) -> None:
        check("down", sigma, outliers, span)
        self.sigma = sigma
        self.outliers = outliers
        self.span = span

    def refusal(self, measurement: DownMeasurement) -> str | None:
        """Refuse a sigma that is not positive."""
        return sigma_refusal(measurement.sigma)

    def weigh(self, particles: ParticleSet, first: int, last: int, measurement: DownMeasurement) -> float:
        """Add the log likelihood of a height; see :class:`filters.sensing.Sensor`."""
        sigma = self.sigma if measurement.sigma is None else measurement.sigma
        mixed = mixture(self.outliers, -math.log(sigma) - _LOG_SQRT_TWO_PI, -math.log(self.span))
        row, gain = particles.row(self.column), math.sqrt(0.5) / sigma
        columns, log_weights = particles.columns, particles.log_weights
        plumb.direct(
            columns,
            log_weights,
            row,
            first,
            last,
            measurement.down,
            gain,
            mixed.log_inlier,
            mixed.log_outlier,
        )
        return mixed.log_peak

    def innovation(self, centre: Mapping[str, float], measurement: DownMeasurement) -> float:
        """Measured less expected height at the centre, metres."""
        return measurement.down - centre[self.column]


@kernel("void(float32[:, ::1], float32[::1], int64, int64, int64, float32, float32, float32, float32)")
def plumb(
    columns: Float32Array,
    log_weights: Float32Array,
    row: int,
    first: int,
    last: int,
    measured: float,
    gain: float,
    log_inlier: float,
    log_outlier: float,
) -> None:
    """Add the log of the mixture."""
    down = columns[row, first:last]
    log_weight = log_weights[first:last]
    for i in range(last - first):
        q = float32(gain * float32(measured - down[i]))
        log_weight[i] += log_mixture(float32(q * q), log_inlier, log_outlier)
