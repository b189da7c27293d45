"""Speeds linearised.

Of a wheel: k (s v - y (w - b)) + c with odometry scale s, gyro bias b, the sensor's own scale k and bias c, by all of
them. Of a velocity: by its direction; where the vehicle stands there is none, and the derivative is taken as 0.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from filters.kalman import Expectation, Matrix
from filters.sensing.speed import (
    GYRO_BIAS,
    ODOMETRY_SCALE,
    VELOCITIES,
    GroundSpeed,
    GroundSpeedMeasurement,
    WheelSpeed,
    WheelSpeedMeasurement,
)


class LinearisedWheelSpeed:
    """Speed of a wheel, of a vehicle whose speed is a control.

    Parameters
    ----------
    sensor : WheelSpeed
        Whose sigma, scale and bias are used.
    """

    def __init__(self, sensor: WheelSpeed) -> None:
        self.sensor = sensor

    def expect(
        self, rows: Mapping[str, int], mean: Matrix, measurement: WheelSpeedMeasurement
    ) -> Expectation:
        """Linearise a speed at ``mean``; see :class:`filters.extended_kalman.LinearisedSensor`."""
        odometry, gyro = rows[ODOMETRY_SCALE], rows[GYRO_BIAS]
        turning = measurement.yaw_rate - float(mean[gyro])
        speed = float(mean[odometry]) * measurement.rolled - measurement.right * turning
        by_speed = {odometry: measurement.rolled, gyro: measurement.right}
        noise = self.sensor.spread(measurement) ** 2
        return _expectation(self.sensor, rows, mean, measurement.speed, (speed, by_speed, noise))


class LinearisedGroundSpeed:
    """Speed of a vehicle whose velocity is a state.

    Parameters
    ----------
    sensor : GroundSpeed
        Whose sigma, scale and bias are used; what a particle's path leaves open is in the covariance.
    """

    def __init__(self, sensor: GroundSpeed) -> None:
        self.sensor = sensor

    def expect(
        self, rows: Mapping[str, int], mean: Matrix, measurement: GroundSpeedMeasurement
    ) -> Expectation:
        """Linearise a speed at ``mean``; see :class:`filters.extended_kalman.LinearisedSensor`."""
        velocity = {rows[name]: float(mean[rows[name]]) for name in VELOCITIES}
        speed = math.hypot(*velocity.values())
        by_speed = {row: value / speed for row, value in velocity.items()} if speed > 0.0 else {}
        sigma = self.sensor.sigma if measurement.sigma is None else measurement.sigma
        return _expectation(self.sensor, rows, mean, measurement.speed, (speed, by_speed, sigma**2))


def _expectation(
    sensor: WheelSpeed | GroundSpeed,
    rows: Mapping[str, int],
    mean: Matrix,
    measured: float,
    expected: tuple[float, Mapping[int, float], float],
) -> Expectation:
    """Return what the sensor makes of a speed, its derivatives by row, and the variance of the noise."""
    speed, derivatives, noise = expected
    scale = 1.0 if sensor.scale is None else float(mean[rows[sensor.scale]])
    bias = 0.0 if sensor.bias is None else float(mean[rows[sensor.bias]])
    jacobian = np.zeros((1, mean.size))
    for row, derivative in derivatives.items():
        jacobian[0, row] = scale * derivative
    if sensor.scale is not None:
        jacobian[0, rows[sensor.scale]] = speed
    if sensor.bias is not None:
        jacobian[0, rows[sensor.bias]] = 1.0
    return Expectation(np.array([measured]), np.array([scale * speed + bias]), jacobian, np.array([[noise]]))
