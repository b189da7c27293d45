"""Position: a fix of a GNSS receiver, or of anything that says where it is.

    expected = (north, east) + rotation(heading) · lever

with the lever from the body's centre to the antenna (forward, right), and the outlier part. Where the fix is older than
its stamp says, by a delay that is itself a slow state, a particle is looked at where it was then
(:mod:`filters.kernels.latency`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from numpy import float32

from filters.kernels.compile import Float32Array, kernel
from filters.kernels.elementary import log_mixture, sincos
from filters.kernels.latency import late_fix
from filters.particle_set import ParticleSet
from filters.sensing.robust import check, mixture, sigma_refusal

_LOG_TWO_PI = math.log(2.0 * math.pi)


class PositionMeasurement(NamedTuple):
    """A horizontal position.

    Attributes
    ----------
    north, east : float
        Metres.
    sigma_north, sigma_east : float or None
        Standard deviations, metres; if only the first is given it holds for both.
    speed, yaw_rate : float
        Of the body about that time, m/s forward and rad/s; they matter only with an unknown delay.
    """

    north: float
    east: float
    sigma_north: float | None = None
    sigma_east: float | None = None
    speed: float = 0.0
    yaw_rate: float = 0.0


class Position:
    """Gaussian position with an outlier part uniform over a square of side ``span``.

    Parameters
    ----------
    sigma : float
        Standard deviation per axis, metres, of measurements that do not state their own.
    outliers : float
        Fraction of measurements that say nothing.
    span : float
        Side of the square that an outlier may fall in, metres.
    lever : (float, float)
        Where the antenna is in the body's frame, metres forward and right.
    delay : str, optional
        Slow state, seconds, by which a fix is older than the time at which it is weighed.

    Raises
    ------
    ValueError
        A parameter out of its range.
    """

    def __init__(
        self,
        sigma: float,
        outliers: float = 0.05,
        span: float = 1000.0,
        lever: tuple[float, float] = (0.0, 0.0),
        delay: str | None = None,
    ) -> None:
        check("position", sigma, outliers, span)
        if not all(math.isfinite(part) for part in lever):
            raise ValueError(f"position: lever must be two finite numbers (forward, right), got {lever}")
        self.sigma = sigma
        self.outliers = outliers
        self.span = span
        self.lever = lever
        self.delay = delay

    def _sigmas(self, measurement: PositionMeasurement) -> tuple[float, float]:
        sigma_north = self.sigma if measurement.sigma_north is None else measurement.sigma_north
        return sigma_north, sigma_north if measurement.sigma_east is None else measurement.sigma_east

    def refusal(self, measurement: PositionMeasurement) -> str | None:
        """Refuse a sigma that is not positive."""
        return sigma_refusal(measurement.sigma_north) or sigma_refusal(measurement.sigma_east)

    def weigh(self, particles: ParticleSet, first: int, last: int, measurement: PositionMeasurement) -> float:
        """Add the log likelihood of a position; see :class:`filters.sensing.Sensor`."""
        sigma_north, sigma_east = self._sigmas(measurement)
        log_density = -_LOG_TWO_PI - math.log(sigma_north) - math.log(sigma_east)
        mixed = mixture(self.outliers, log_density, -2.0 * math.log(self.span))
        if self.delay is not None:
            late_fix.direct(
                particles.columns,
                particles.log_weights,
                first,
                last,
                particles.row(self.delay),
                measurement.speed,
                measurement.yaw_rate,
                measurement.north,
                measurement.east,
                math.sqrt(0.5) / sigma_north,
                math.sqrt(0.5) / sigma_east,
                self.lever[0],
                self.lever[1],
                mixed.log_inlier,
                mixed.log_outlier,
            )
            return mixed.log_peak
        fix.direct(
            particles.columns,
            particles.log_weights,
            first,
            last,
            measurement.north,
            measurement.east,
            math.sqrt(0.5) / sigma_north,
            math.sqrt(0.5) / sigma_east,
            self.lever[0],
            self.lever[1],
            mixed.log_inlier,
            mixed.log_outlier,
        )
        return mixed.log_peak

    def innovation(self, centre: Mapping[str, float], measurement: PositionMeasurement) -> float:
        """Distance between measured and expected position at the centre, metres."""
        delay = 0.0 if self.delay is None else centre[self.delay]
        heading = centre["heading"] - 0.5 * measurement.yaw_rate * delay
        forward, right = self.lever[0] - measurement.speed * delay, self.lever[1]
        north = centre["north"] + forward * math.cos(heading) - right * math.sin(heading)
        east = centre["east"] + forward * math.sin(heading) + right * math.cos(heading)
        return math.hypot(measurement.north - north, measurement.east - east)


@kernel(
    "void(float32[:, ::1], float32[::1], int64, int64, float32, float32, float32, float32, float32, float32,"
    "float32, float32)"
)
def fix(
    columns: Float32Array,
    log_weights: Float32Array,
    first: int,
    last: int,
    measured_north: float,
    measured_east: float,
    gain_north: float,
    gain_east: float,
    forward: float,
    right: float,
    log_inlier: float,
    log_outlier: float,
) -> None:
    """Add the log of the mixture at the antenna's place."""
    north = columns[0, first:last]
    east = columns[1, first:last]
    heading = columns[2, first:last]
    log_weight = log_weights[first:last]
    for i in range(last - first):
        s, c = sincos(heading[i])
        n = float32(gain_north * float32(measured_north - north[i] - forward * c + right * s))
        e = float32(gain_east * float32(measured_east - east[i] - forward * s - right * c))
        log_weight[i] += log_mixture(float32(n * n + e * e), log_inlier, log_outlier)
