"""Velocity: over ground, as a GNSS receiver measures it; for a vehicle that moves along its heading.

    expected = scale · speed · (cos heading, sin heading)

with the speed that odometry or control says, and the odometer's scale if it is a state. So it bears on the
heading (as a course) and on the scale. With the outlier part. A delay may be a slow state, as of a position.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from numpy import float32

from filters.kernels.compile import Float32Array, kernel
from filters.kernels.elementary import log_mixture, sincos
from filters.kernels.latency import late_course
from filters.particle_set import ParticleSet
from filters.sensing.robust import check, mixture, sigma_refusal

_LOG_TWO_PI = math.log(2.0 * math.pi)


class VelocityMeasurement(NamedTuple):
    """A horizontal velocity.

    Attributes
    ----------
    north, east : float
        Measured, m/s.
    speed : float
        Forward speed over the same time by odometry or control, m/s; negative is backwards.
    sigma : float or None
        Standard deviation per axis, m/s, if the measurement says so.
    yaw_rate : float
        Of the body about that time, rad/s; it matters only with an unknown delay.
    """

    north: float
    east: float
    speed: float
    sigma: float | None = None
    yaw_rate: float = 0.0


class Velocity:
    """Gaussian velocity with an outlier part uniform over a square of side ``span``.

    Parameters
    ----------
    sigma : float
        Standard deviation per axis, m/s, of measurements that do not state their own.
    outliers : float
        Fraction of measurements that say nothing.
    span : float
        Side of the square that an outlier may fall in, m/s; a faster one than half of it is refused.
    scale : str, optional
        Slow state that the speed is multiplied by.
    delay : str, optional
        Slow state, seconds, by which a velocity is older than the time at which it is weighed.

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
        delay: str | None = None,
    ) -> None:
        check("velocity", sigma, outliers, span)
        self.sigma = sigma
        self.outliers = outliers
        self.span = span
        self.scale = scale
        self.delay = delay

    def refusal(self, measurement: VelocityMeasurement) -> str | None:
        """Refuse a velocity outside the span, and a sigma that is not positive."""
        if max(abs(measurement.north), abs(measurement.east)) > 0.5 * self.span:
            return f"velocity must lie within {0.5 * self.span:g} m/s per axis"
        return sigma_refusal(measurement.sigma)

    def weigh(self, particles: ParticleSet, first: int, last: int, measurement: VelocityMeasurement) -> float:
        """Add the log likelihood of a velocity; see :class:`filters.sensing.Sensor`."""
        north, east, speed, sigma, yaw_rate = measurement
        if sigma is None:
            sigma = self.sigma
        log_density = -_LOG_TWO_PI - 2.0 * math.log(sigma)
        mixed = mixture(self.outliers, log_density, -2.0 * math.log(self.span))
        scale_row, scale_slope = (0, 0.0) if self.scale is None else (particles.row(self.scale), 1.0)
        if self.delay is not None:
            late_course.direct(
                particles.columns,
                particles.log_weights,
                first,
                last,
                particles.row(self.delay),
                yaw_rate,
                north,
                east,
                speed,
                math.sqrt(0.5) / sigma,
                scale_row,
                scale_slope,
                mixed.log_inlier,
                mixed.log_outlier,
            )
            return mixed.log_peak
        course.direct(
            particles.columns,
            particles.log_weights,
            first,
            last,
            north,
            east,
            speed,
            math.sqrt(0.5) / sigma,
            scale_row,
            scale_slope,
            mixed.log_inlier,
            mixed.log_outlier,
        )
        return mixed.log_peak

    def innovation(self, centre: Mapping[str, float], measurement: VelocityMeasurement) -> float:
        """Distance between measured and expected velocity at the centre, m/s."""
        speed = measurement.speed * (1.0 if self.scale is None else centre[self.scale])
        heading = centre["heading"] - (
            0.0 if self.delay is None else measurement.yaw_rate * centre[self.delay]
        )
        return math.hypot(
            measurement.north - speed * math.cos(heading), measurement.east - speed * math.sin(heading)
        )


@kernel(
    "void(float32[:, ::1], float32[::1], int64, int64, float32, float32, float32, float32, int64, float32,"
    "float32, float32)"
)
def course(
    columns: Float32Array,
    log_weights: Float32Array,
    first: int,
    last: int,
    measured_north: float,
    measured_east: float,
    speed: float,
    gain: float,
    scale_row: int,
    scale_slope: float,
    log_inlier: float,
    log_outlier: float,
) -> None:
    """Add the log of the mixture; without a scale its slope is 0."""
    heading = columns[2, first:last]
    scale = columns[scale_row, first:last]
    log_weight = log_weights[first:last]
    for i in range(last - first):
        s, c = sincos(heading[i])
        scaled = float32(speed * float32(scale_slope * scale[i] + float32(float32(1.0) - scale_slope)))
        n = float32(gain * float32(measured_north - scaled * c))
        e = float32(gain * float32(measured_east - scaled * s))
        log_weight[i] += log_mixture(float32(n * n + e * e), log_inlier, log_outlier)
