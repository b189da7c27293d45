"""What many Gaussians of a unicycle lead a measurement to expect: residual, Jacobian and noise of every live member.

Each kernel writes the rows of the live members, of arrays that hold zeros before, and says whether every residual is a
finite number. The state's first dimensions are north, east and heading. A row of -1 stands for a state that there is
not.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from filters.kernels.compile import function, kernel

Float64Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


@function
def angle_between(angle: float) -> float:
    """An angle in [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@kernel(
    "boolean(float64[:, ::1], bool_[::1], float64, float64, float64, float64, float64, float64, float64[:, ::1],"
    "float64[:, :, ::1], float64[:, ::1])",
    exact=True,
)
def expect_position(
    mean: Float64Array,
    live: Flags,
    north: float,
    east: float,
    forward: float,
    right: float,
    sigma_north: float,
    sigma_east: float,
    residual: Float64Array,
    jacobian: Float64Array,
    noise: Float64Array,
) -> bool:
    """A position of the antenna, which is ``forward`` and ``right`` of the vehicle's own."""
    finite = True
    for m in range(mean.shape[0]):
        if not live[m]:
            continue
        sine, cosine = math.sin(mean[m, 2]), math.cos(mean[m, 2])
        ahead, aside = forward * cosine - right * sine, forward * sine + right * cosine
        residual[m, 0] = north - mean[m, 0] - ahead
        residual[m, 1] = east - mean[m, 1] - aside
        jacobian[m, 0, 0] = jacobian[m, 1, 1] = 1.0
        jacobian[m, 0, 2], jacobian[m, 1, 2] = -aside, ahead
        noise[m, 0], noise[m, 1] = sigma_north * sigma_north, sigma_east * sigma_east
        finite = finite and math.isfinite(residual[m, 0] + residual[m, 1])
    return finite


@kernel(
    "boolean(float64[:, ::1], bool_[::1], float64, float64, float64, int64, float64, float64[:, ::1],"
    "float64[:, :, ::1], float64[:, ::1])",
    exact=True,
)
def expect_velocity(
    mean: Float64Array,
    live: Flags,
    north: float,
    east: float,
    speed: float,
    scale: int,
    sigma: float,
    residual: Float64Array,
    jacobian: Float64Array,
    noise: Float64Array,
) -> bool:
    """A velocity over ground, of a vehicle whose odometer says ``speed``."""
    finite = True
    for m in range(mean.shape[0]):
        if not live[m]:
            continue
        sine, cosine = math.sin(mean[m, 2]), math.cos(mean[m, 2])
        true_speed = speed
        if scale >= 0:
            true_speed *= mean[m, scale]
            jacobian[m, 0, scale], jacobian[m, 1, scale] = speed * cosine, speed * sine
        jacobian[m, 0, 2], jacobian[m, 1, 2] = -true_speed * sine, true_speed * cosine
        residual[m, 0] = north - true_speed * cosine
        residual[m, 1] = east - true_speed * sine
        noise[m, 0] = noise[m, 1] = sigma * sigma
        finite = finite and math.isfinite(residual[m, 0] + residual[m, 1])
    return finite


@kernel(
    "boolean(float64[:, ::1], bool_[::1], float64, float64, float64, float64, int64, int64, float64,"
    "float64[:, ::1], float64[:, :, ::1], float64[:, ::1])",
    exact=True,
)
def expect_range(
    mean: Float64Array,
    live: Flags,
    measured: float,
    north: float,
    east: float,
    down_difference: float,
    scale: int,
    bias: int,
    sigma: float,
    residual: Float64Array,
    jacobian: Float64Array,
    noise: Float64Array,
) -> bool:
    """A range to a place."""
    finite = True
    for m in range(mean.shape[0]):
        if not live[m]:
            continue
        away_north, away_east = mean[m, 0] - north, mean[m, 1] - east
        distance = math.sqrt(
            away_north * away_north + away_east * away_east + down_difference * down_difference
        )
        factor = mean[m, scale] if scale >= 0 else 1.0
        offset = mean[m, bias] if bias >= 0 else 0.0
        per_metre = factor / distance if distance > 0.0 else 0.0
        jacobian[m, 0, 0], jacobian[m, 0, 1] = per_metre * away_north, per_metre * away_east
        if scale >= 0:
            jacobian[m, 0, scale] = distance
        if bias >= 0:
            jacobian[m, 0, bias] = 1.0
        residual[m, 0] = measured - factor * distance - offset
        noise[m, 0] = sigma * sigma
        finite = finite and math.isfinite(residual[m, 0])
    return finite


@kernel(
    "boolean(float64[:, ::1], bool_[::1], float64, int64, float64, float64[:, ::1], float64[:, :, ::1],"
    "float64[:, ::1])",
    exact=True,
)
def expect_heading(
    mean: Float64Array,
    live: Flags,
    heading: float,
    bias: int,
    sigma: float,
    residual: Float64Array,
    jacobian: Float64Array,
    noise: Float64Array,
) -> bool:
    """A heading."""
    finite = True
    for m in range(mean.shape[0]):
        if not live[m]:
            continue
        expected = mean[m, 2]
        jacobian[m, 0, 2] = 1.0
        if bias >= 0:
            expected += mean[m, bias]
            jacobian[m, 0, bias] = 1.0
        residual[m, 0] = angle_between(heading - expected)
        noise[m, 0] = sigma * sigma
        finite = finite and math.isfinite(residual[m, 0])
    return finite


@kernel(
    "boolean(float64[:, ::1], bool_[::1], float64, float64, float64, float64, int64, int64, int64, int64, float64,"
    "float64[:, ::1], float64[:, :, ::1], float64[:, ::1])",
    exact=True,
)
def expect_wheel_speed(
    mean: Float64Array,
    live: Flags,
    measured: float,
    rolled: float,
    yaw_rate: float,
    right: float,
    gyro: int,
    odometry: int,
    scale: int,
    bias: int,
    sigma: float,
    residual: Float64Array,
    jacobian: Float64Array,
    noise: Float64Array,
) -> bool:
    """A forward speed, so far right of the centre, where odometry and gyro say what they do."""
    finite = True
    for m in range(mean.shape[0]):
        if not live[m]:
            continue
        speed = mean[m, odometry] * rolled - right * (yaw_rate - mean[m, gyro])
        factor = mean[m, scale] if scale >= 0 else 1.0
        offset = mean[m, bias] if bias >= 0 else 0.0
        jacobian[m, 0, odometry], jacobian[m, 0, gyro] = factor * rolled, factor * right
        if scale >= 0:
            jacobian[m, 0, scale] = speed
        if bias >= 0:
            jacobian[m, 0, bias] = 1.0
        residual[m, 0] = measured - factor * speed - offset
        noise[m, 0] = sigma * sigma
        finite = finite and math.isfinite(residual[m, 0])
    return finite


@kernel("void(float64[:, :, ::1], float64[:, :, ::1], int64, float64[:, ::1])", exact=True)
def spread_of(covariance: Float64Array, jacobian: Float64Array, member: int, spread: Float64Array) -> None:
    """H C Hᵀ of one member: how uncertain what it expects is."""
    c, h = covariance[member], jacobian[member]
    size = c.shape[0]
    for i in range(h.shape[0]):
        for j in range(h.shape[0]):
            total = 0.0
            for k in range(size):
                inner = 0.0
                for q in range(size):
                    inner += c[k, q] * h[j, q]
                total += h[i, k] * inner
            spread[i, j] = total


@kernel(
    "void(float64[::1], bool_[::1], float64, float64, float64, float64, float64, float64[::1], float64[::1])",
    exact=True,
)
def note(
    nis: Float64Array,
    chosen: Flags,
    expected: float,
    most: float,
    wild: float,
    repeats: float,
    memory: float,
    contradiction: Float64Array,
    wildness: Float64Array,
) -> None:
    """Add what a measurement contradicts the chosen members by to what has contradicted them; it repeats others."""
    for m in range(nis.size):
        if chosen[m]:
            contradiction[m] += (min(nis[m], most) - expected) / repeats
            strange = 1.0 if nis[m] > wild else 0.0
            wildness[m] += memory / repeats * (strange - wildness[m])
