"""What a bank expects of a fix that is older than it says: each member looks at where it was its own delay ago.

The same as :class:`filters.linearised.LinearisedPosition` and :class:`filters.linearised.LinearisedVelocity` have for
one Gaussian, for many at once: with the delay δ a state, v the forward speed and ω the yaw rate about that time::

    place     (north, east) + R(h - ω δ / 2) (lever - (v δ, 0))
    velocity  scale v (cos, sin)(h - ω δ)
"""

from __future__ import annotations

import numpy as np

from filters.kalman import Matrix
from filters.sensing import Position, PositionMeasurement, Velocity, VelocityMeasurement


def look_back_at_place(
    sensor: Position,
    measurement: PositionMeasurement,
    delay: int,
    mean: Matrix,
    residual: Matrix,
    jacobian: Matrix,
) -> None:
    """Write residuals (n, 2) and Jacobians (n, 2, d) of a late position, of members with these means (n, d)."""
    forward = sensor.lever[0] - measurement.speed * mean[:, delay]
    right, half_turn = sensor.lever[1], 0.5 * measurement.yaw_rate
    direction = mean[:, 2] - half_turn * mean[:, delay]
    sine, cosine = np.sin(direction), np.cos(direction)
    ahead, aside = forward * cosine - right * sine, forward * sine + right * cosine
    residual[:, 0] = measurement.north - mean[:, 0] - ahead
    residual[:, 1] = measurement.east - mean[:, 1] - aside
    jacobian[:, 0, 2], jacobian[:, 1, 2] = -aside, ahead
    jacobian[:, 0, delay] = half_turn * aside - measurement.speed * cosine
    jacobian[:, 1, delay] = -half_turn * ahead - measurement.speed * sine


def look_back_at_velocity(
    sensor: Velocity,
    measurement: VelocityMeasurement,
    delay: int,
    scale: int,
    mean: Matrix,
    residual: Matrix,
    jacobian: Matrix,
) -> None:
    """Write residuals (n, 2) and Jacobians (n, 2, d) of a late velocity; a scale of row -1 is 1."""
    direction = mean[:, 2] - measurement.yaw_rate * mean[:, delay]
    sine, cosine = np.sin(direction), np.cos(direction)
    speed = measurement.speed * (mean[:, scale] if scale >= 0 else 1.0)
    residual[:, 0] = measurement.north - speed * cosine
    residual[:, 1] = measurement.east - speed * sine
    jacobian[:, 0, 2], jacobian[:, 1, 2] = -speed * sine, speed * cosine
    jacobian[:, :, delay] = -measurement.yaw_rate * jacobian[:, :, 2]
    if scale >= 0:
        jacobian[:, 0, scale], jacobian[:, 1, scale] = measurement.speed * cosine, measurement.speed * sine
