"""Altitude: how far above the origin the vehicle is, by a barometer or whatever else measures upwards.

    expected = -down + bias

down is a state, and so may be the bias: of a barometer it is the weather. It is marginalised
(:mod:`filters.sensing.learned_bias`). With the outlier part.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from numpy import float32

from filters.kernels.compile import Float32Array, kernel
from filters.particle_set import ParticleSet
from filters.sensing.learned_bias import learn, lesson, weighed
from filters.sensing.robust import check, sigma_refusal


class AltitudeMeasurement(NamedTuple):
    """An altitude, metres above the origin, and its standard deviation, metres, if the measurement says so."""

    altitude: float
    sigma: float | None = None


class Altitude:
    """Gaussian altitude with an outlier part uniform over ``span`` metres.

    Parameters
    ----------
    sigma : float
        Standard deviation, metres, of measurements that do not state their own.
    outliers : float
        Fraction of measurements that say nothing.
    span : float
        How widely outliers scatter, metres.
    bias : str, optional
        Slow state that is added to the altitude.

    Raises
    ------
    ValueError
        A parameter out of its range.
    """

    column = "down"

    def __init__(
        self, sigma: float, outliers: float = 0.05, span: float = 1000.0, bias: str | None = None
    ) -> None:
        check("altitude", sigma, outliers, span)
        self.sigma = sigma
        self.outliers = outliers
        self.span = span
        self.bias = bias

    def refusal(self, measurement: AltitudeMeasurement) -> str | None:
        """Refuse a sigma that is not positive."""
        return sigma_refusal(measurement.sigma)

    def spread(self, measurement: AltitudeMeasurement) -> float:
        """Return the measurement's standard deviation, metres."""
        return self.sigma if measurement.sigma is None else measurement.sigma

    def weigh(self, particles: ParticleSet, first: int, last: int, measurement: AltitudeMeasurement) -> float:
        """Add the log likelihood and teach the means of the bias; see :class:`filters.sensing.Sensor`."""
        told = lesson(particles, self.bias, self.spread(measurement), self.outliers, self.span)
        ascend.direct(
            particles.columns,
            particles.log_weights,
            particles.row(self.column),
            first,
            last,
            measurement.altitude,
            told.gain,
            told.log_inlier,
            told.log_outlier,
            told.row,
            told.slope,
            told.teach,
        )
        return told.log_peak

    def learn(self, particles: ParticleSet, measurement: AltitudeMeasurement, log_mean: float) -> None:
        """Take what was learned of the bias off its variance; see :class:`filters.sensing.model.Learner`."""
        learn(particles, self.bias, self.spread(measurement), self.outliers, self.span, log_mean)

    def innovation(self, centre: Mapping[str, float], measurement: AltitudeMeasurement) -> float:
        """Measured less expected altitude at the centre, metres."""
        bias = 0.0 if self.bias is None else centre[self.bias]
        return measurement.altitude + centre[self.column] - bias


@kernel(
    "void(float32[:, ::1], float32[::1], int64, int64, int64, float32, float32, float32, float32, int64, float32,"
    "float32)"
)
def ascend(
    columns: Float32Array,
    log_weights: Float32Array,
    down_row: int,
    first: int,
    last: int,
    measured: float,
    gain: float,
    log_inlier: float,
    log_outlier: float,
    bias_row: int,
    bias_slope: float,
    teach: float,
) -> None:
    """Add the log of the mixture; without a bias its slope and its lesson are 0."""
    down = columns[down_row, first:last]
    bias = columns[bias_row, first:last]
    log_weight = log_weights[first:last]
    for i in range(last - first):
        r = float32(measured + down[i] - bias_slope * bias[i])
        density, step = weighed(r, gain, log_inlier, log_outlier, teach)
        log_weight[i] += density
        bias[i] += step
