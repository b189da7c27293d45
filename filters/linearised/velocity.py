"""Velocity linearised: of scale · speed · (cos heading, sin heading), by the heading, the scale and the delay."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from filters.kalman import Expectation, Matrix
from filters.sensing.velocity import Velocity, VelocityMeasurement


class LinearisedVelocity:
    """Horizontal velocity over ground; a component that is NaN was not measured.

    Parameters
    ----------
    sensor : Velocity
        Whose sigma and scale are used.
    """

    def __init__(self, sensor: Velocity) -> None:
        self.sensor = sensor

    def expect(self, rows: Mapping[str, int], mean: Matrix, measurement: VelocityMeasurement) -> Expectation:
        """Linearise a velocity at ``mean``; see :class:`filters.extended_kalman.LinearisedSensor`."""
        heading, scale = rows["heading"], self.sensor.scale
        speed = measurement.speed * (1.0 if scale is None else float(mean[rows[scale]]))
        delay = 0.0 if self.sensor.delay is None else float(mean[rows[self.sensor.delay]])
        then = float(mean[heading]) - measurement.yaw_rate * delay
        direction = np.array([math.cos(then), math.sin(then)])
        jacobian = np.zeros((2, mean.size))
        jacobian[:, heading] = (-speed * direction[1], speed * direction[0])
        if self.sensor.delay is not None:
            jacobian[:, rows[self.sensor.delay]] = -measurement.yaw_rate * jacobian[:, heading]
        if scale is not None:
            jacobian[:, rows[scale]] = measurement.speed * direction
        sigma = self.sensor.sigma if measurement.sigma is None else measurement.sigma
        return Expectation(
            np.array([measurement.north, measurement.east]),
            speed * direction,
            jacobian,
            sigma**2 * np.eye(2),
        )
