"""Speed: how fast the vehicle goes, by a wheel, a radar, or a receiver's Doppler shift.

A vehicle that rolls ahead (:class:`WheelSpeed`) has no speed among its states: the odometry says it, times a scale that
is one. A wheel beside its centre turns with it, slower on the side that it turns to::

    expected = scale · (odometry scale · speed - right · (yaw rate - gyro bias)) + bias

A vehicle of which only a velocity is known (:class:`GroundSpeed`) is taken to move with its nose ahead::

    expected = scale · sqrt(north² + east² + P) + bias

with P the variance, given a particle's path, of each component of the velocity: the mean of a speed lies above the
speed of the mean (Rice, "Mathematical analysis of random noise", Bell System Technical Journal 24, 1945, section 3.10,
to a quarter of the root of P where the vehicle stands and to the second order where it goes).

Scale and bias are slow states if named, the bias marginalised (:mod:`filters.sensing.learned_bias`). With the outlier
part.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Generic, NamedTuple, TypeVar

from numpy import float32

from filters.kernels.compile import Float32Array, kernel
from filters.particle_set import ParticleSet
from filters.sensing.learned_bias import Lesson, learn, lesson, weighed
from filters.sensing.robust import check, sigma_refusal

ODOMETRY_SCALE = "odometry_scale"
GYRO_BIAS = "gyro_bias"
VELOCITIES = ("velocity_north", "velocity_east")


class WheelSpeedMeasurement(NamedTuple):
    """A forward speed beside what odometry and gyro said of the same moment.

    Attributes
    ----------
    speed : float
        Measured, m/s; negative is backwards.
    rolled : float
        Of the centre, by the odometry, m/s.
    yaw_rate : float
        By the gyro, rad/s, clockwise.
    right : float
        How far right of the centre it was measured, metres.
    sigma : float or None
        Standard deviation, m/s, if the measurement says so; with that of ``rolled`` in it.
    """

    speed: float
    rolled: float
    yaw_rate: float = 0.0
    right: float = 0.0
    sigma: float | None = None


class GroundSpeedMeasurement(NamedTuple):
    """A speed over ground.

    Attributes
    ----------
    speed : float
        Measured, m/s, not negative.
    sigma : float or None
        Standard deviation, m/s, if the measurement says so.
    loose : float
        Variance of each component of the velocity given a particle's path, (m/s)².
    """

    speed: float
    sigma: float | None = None
    loose: float = 0.0


Said = TypeVar("Said", WheelSpeedMeasurement, GroundSpeedMeasurement)


class _Speed(ABC, Generic[Said]):
    """What both models of a speed have in common.

    Parameters
    ----------
    sigma : float
        Standard deviation, m/s, of measurements that do not state their own.
    outliers : float
        Fraction of measurements that say nothing.
    span : float
        How widely outliers scatter, m/s; a speed that is faster is refused.
    scale : str, optional
        Slow state that the speed is multiplied by.
    bias : str, optional
        Slow state that is added to it.

    Raises
    ------
    ValueError
        A parameter out of its range.
    """

    def __init__(
        self,
        sigma: float,
        outliers: float = 0.05,
        span: float = 100.0,
        scale: str | None = None,
        bias: str | None = None,
    ) -> None:
        check("speed", sigma, outliers, span)
        self.sigma = sigma
        self.outliers = outliers
        self.span = span
        self.scale = scale
        self.bias = bias

    @abstractmethod
    def spread(self, measurement: Said) -> float:
        """Return the measurement's standard deviation, m/s."""

    def learn(self, particles: ParticleSet, measurement: Said, log_mean: float) -> None:
        """Take what was learned of the bias off its variance; see :class:`filters.sensing.model.Learner`."""
        learn(particles, self.bias, self.spread(measurement), self.outliers, self.span, log_mean)

    def _refusal(self, speed: float, sigma: float | None) -> str | None:
        if abs(speed) > self.span:
            return f"speed must lie within {self.span:g} m/s"
        return sigma_refusal(sigma)

    def _lesson(self, particles: ParticleSet, sigma: float) -> Lesson:
        return lesson(particles, self.bias, sigma, self.outliers, self.span)

    def _scale(self, particles: ParticleSet) -> tuple[int, float]:
        return (0, 0.0) if self.scale is None else (particles.row(self.scale), 1.0)

    def _said(self, centre: Mapping[str, float], speed: float) -> float:
        """Return what the sensor says of a speed, at the centre."""
        scale = 1.0 if self.scale is None else centre[self.scale]
        return scale * speed + (0.0 if self.bias is None else centre[self.bias])


class WheelSpeed(_Speed[WheelSpeedMeasurement]):
    """Gaussian speed, of a vehicle whose speed is a control, with an outlier part uniform over ``span``."""

    def refusal(self, measurement: WheelSpeedMeasurement) -> str | None:
        """Refuse a speed beyond the span, and a sigma that is not positive."""
        return self._refusal(measurement.speed, measurement.sigma)

    def spread(self, measurement: WheelSpeedMeasurement) -> float:
        """Return the measurement's standard deviation, m/s."""
        return self.sigma if measurement.sigma is None else measurement.sigma

    def weigh(
        self, particles: ParticleSet, first: int, last: int, measurement: WheelSpeedMeasurement
    ) -> float:
        """Add the log likelihood and teach the means of the bias; see :class:`filters.sensing.Sensor`."""
        told = self._lesson(particles, self.spread(measurement))
        rolling.direct(
            particles.columns,
            particles.log_weights,
            first,
            last,
            measurement.speed,
            measurement.rolled,
            measurement.yaw_rate,
            measurement.right,
            particles.row(ODOMETRY_SCALE),
            particles.row(GYRO_BIAS),
            *self._scale(particles),
            told.gain,
            told.log_inlier,
            told.log_outlier,
            told.row,
            told.slope,
            told.teach,
        )
        return told.log_peak

    def innovation(self, centre: Mapping[str, float], measurement: WheelSpeedMeasurement) -> float:
        """Measured less expected speed at the centre, m/s."""
        turning = measurement.yaw_rate - centre[GYRO_BIAS]
        speed = centre[ODOMETRY_SCALE] * measurement.rolled - measurement.right * turning
        return measurement.speed - self._said(centre, speed)


class GroundSpeed(_Speed[GroundSpeedMeasurement]):
    """Gaussian speed, of a vehicle whose velocity is a state, with an outlier part uniform over ``span``."""

    def refusal(self, measurement: GroundSpeedMeasurement) -> str | None:
        """Refuse a speed below zero or beyond the span, a sigma that is not positive, a variance below zero."""
        if measurement.speed < 0.0 or measurement.loose < 0.0:
            return (
                f"speed and its variance must not be negative, got {measurement.speed}, {measurement.loose}"
            )
        return self._refusal(measurement.speed, measurement.sigma)

    def spread(self, measurement: GroundSpeedMeasurement) -> float:
        """Return the measurement's standard deviation given a particle's mean velocity, m/s."""
        own = self.sigma if measurement.sigma is None else measurement.sigma
        return math.sqrt(own * own + measurement.loose)

    def weigh(
        self, particles: ParticleSet, first: int, last: int, measurement: GroundSpeedMeasurement
    ) -> float:
        """Add the log likelihood and teach the means of the bias; see :class:`filters.sensing.Sensor`."""
        told = self._lesson(particles, self.spread(measurement))
        moving.direct(
            particles.columns,
            particles.log_weights,
            first,
            last,
            measurement.speed,
            measurement.loose,
            particles.row(VELOCITIES[0]),
            particles.row(VELOCITIES[1]),
            *self._scale(particles),
            told.gain,
            told.log_inlier,
            told.log_outlier,
            told.row,
            told.slope,
            told.teach,
        )
        return told.log_peak

    def innovation(self, centre: Mapping[str, float], measurement: GroundSpeedMeasurement) -> float:
        """Measured less expected speed at the centre, m/s."""
        north, east = (centre[name] for name in VELOCITIES)
        return measurement.speed - self._said(centre, math.sqrt(north**2 + east**2 + measurement.loose))


@kernel(
    "void(float32[:, ::1], float32[::1], int64, int64, float32, float32, float32, float32, int64, int64, int64,"
    "float32, float32, float32, float32, int64, float32, float32)"
)
def rolling(
    columns: Float32Array,
    log_weights: Float32Array,
    first: int,
    last: int,
    measured: float,
    rolled: float,
    yaw_rate: float,
    right: float,
    odometry_row: int,
    gyro_row: int,
    scale_row: int,
    scale_slope: float,
    gain: float,
    log_inlier: float,
    log_outlier: float,
    bias_row: int,
    bias_slope: float,
    teach: float,
) -> None:
    """Add the log of the mixture; without a scale or bias their slopes and the lesson are 0."""
    odometry = columns[odometry_row, first:last]
    gyro = columns[gyro_row, first:last]
    scale = columns[scale_row, first:last]
    bias = columns[bias_row, first:last]
    log_weight = log_weights[first:last]
    for i in range(last - first):
        speed = float32(odometry[i] * rolled - right * float32(yaw_rate - gyro[i]))
        factor = float32(scale_slope * scale[i] + float32(float32(1.0) - scale_slope))
        r = float32(measured - float32(factor * speed + bias_slope * bias[i]))
        density, step = weighed(r, gain, log_inlier, log_outlier, teach)
        log_weight[i] += density
        bias[i] += step


@kernel(
    "void(float32[:, ::1], float32[::1], int64, int64, float32, float32, int64, int64, int64, float32, float32,"
    "float32, float32, int64, float32, float32)"
)
def moving(
    columns: Float32Array,
    log_weights: Float32Array,
    first: int,
    last: int,
    measured: float,
    loose: float,
    north_row: int,
    east_row: int,
    scale_row: int,
    scale_slope: float,
    gain: float,
    log_inlier: float,
    log_outlier: float,
    bias_row: int,
    bias_slope: float,
    teach: float,
) -> None:
    """Add the log of the mixture; without a scale or bias their slopes and the lesson are 0."""
    north = columns[north_row, first:last]
    east = columns[east_row, first:last]
    scale = columns[scale_row, first:last]
    bias = columns[bias_row, first:last]
    log_weight = log_weights[first:last]
    for i in range(last - first):
        speed = float32(math.sqrt(float32(north[i] * north[i] + east[i] * east[i] + loose)))
        factor = float32(scale_slope * scale[i] + float32(float32(1.0) - scale_slope))
        r = float32(measured - float32(factor * speed + bias_slope * bias[i]))
        density, step = weighed(r, gain, log_inlier, log_outlier, teach)
        log_weight[i] += density
        bias[i] += step
