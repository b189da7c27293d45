"""Weighing by readings that are older than they say: each particle is looked at where it was a delay ago.

With the delay δ in a column of its own, v the forward speed and ω the yaw rate about that time, a particle at heading h
was, to second order in δ::

    place     (north, east) - δ v (cos, sin)(h - ω δ / 2)
    heading   h - ω δ
"""

from __future__ import annotations

from numpy import float32

from filters.kernels.compile import Float32Array, kernel
from filters.kernels.elementary import log_mixture, sincos


@kernel(
    "void(float32[:, ::1], float32[::1], int64, int64, int64, float32, float32, float32, float32, float32, float32,"
    "float32, float32, float32, float32)"
)
def late_fix(
    columns: Float32Array,
    log_weights: Float32Array,
    first: int,
    last: int,
    delay_row: int,
    speed: float,
    yaw_rate: float,
    measured_north: float,
    measured_east: float,
    gain_north: float,
    gain_east: float,
    forward: float,
    right: float,
    log_inlier: float,
    log_outlier: float,
) -> None:
    """Add the log of the mixture at the place where the antenna was."""
    north = columns[0, first:last]
    east = columns[1, first:last]
    heading = columns[2, first:last]
    delay = columns[delay_row, first:last]
    log_weight = log_weights[first:last]
    for i in range(last - first):
        d = delay[i]
        turned = float32(yaw_rate * d)
        s, c = sincos(float32(heading[i] - float32(0.5) * turned))
        rolled = float32(speed * d)
        # the lever's arm turns with the body; half a small turn is close enough for it
        n = float32(
            gain_north * float32(measured_north - north[i] - float32(forward - rolled) * c + right * s)
        )
        e = float32(gain_east * float32(measured_east - east[i] - float32(forward - rolled) * s - right * c))
        log_weight[i] += log_mixture(float32(n * n + e * e), log_inlier, log_outlier)


@kernel(
    "void(float32[:, ::1], float32[::1], int64, int64, int64, float32, float32, float32, float32, float32, int64,"
    "float32, float32, float32)"
)
def late_course(
    columns: Float32Array,
    log_weights: Float32Array,
    first: int,
    last: int,
    delay_row: int,
    yaw_rate: float,
    measured_north: float,
    measured_east: float,
    speed: float,
    gain: float,
    scale_row: int,
    scale_slope: float,
    log_inlier: float,
    log_outlier: float,
) -> None:
    """Add the log of the mixture for the way the body pointed then; without a scale its slope is 0."""
    heading = columns[2, first:last]
    delay = columns[delay_row, first:last]
    scale = columns[scale_row, first:last]
    log_weight = log_weights[first:last]
    for i in range(last - first):
        s, c = sincos(float32(heading[i] - yaw_rate * delay[i]))
        scaled = float32(speed * float32(scale_slope * scale[i] + float32(float32(1.0) - scale_slope)))
        n = float32(gain * float32(measured_north - scaled * c))
        e = float32(gain * float32(measured_east - scaled * s))
        log_weight[i] += log_mixture(float32(n * n + e * e), log_inlier, log_outlier)
