"""Position linearised: the identity in north and east, the lever's swing in the heading, the way back in the delay."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from filters.kalman import Expectation, Matrix
from filters.sensing.position import Position, PositionMeasurement


class LinearisedPosition:
    """Horizontal position of the antenna; a component that is NaN was not measured.

    Parameters
    ----------
    sensor : Position
        Whose sigma and lever are used.
    """

    def __init__(self, sensor: Position) -> None:
        self.sensor = sensor

    def expect(self, rows: Mapping[str, int], mean: Matrix, measurement: PositionMeasurement) -> Expectation:
        """Linearise a position at ``mean``; see :class:`filters.extended_kalman.LinearisedSensor`."""
        north, east, heading = rows["north"], rows["east"], rows["heading"]
        delay = 0.0 if self.sensor.delay is None else float(mean[rows[self.sensor.delay]])
        forward, right = self.sensor.lever[0] - measurement.speed * delay, self.sensor.lever[1]
        half_turn = 0.5 * measurement.yaw_rate
        direction = float(mean[heading]) - half_turn * delay
        sine, cosine = math.sin(direction), math.cos(direction)
        swing = np.array([forward * cosine - right * sine, forward * sine + right * cosine])
        jacobian = np.zeros((2, mean.size))
        jacobian[0, north] = jacobian[1, east] = 1.0
        jacobian[:, heading] = (-swing[1], swing[0])
        if self.sensor.delay is not None:
            along = measurement.speed * np.array([cosine, sine])
            jacobian[:, rows[self.sensor.delay]] = -along - half_turn * jacobian[:, heading]
        sigma_north = self.sensor.sigma if measurement.sigma_north is None else measurement.sigma_north
        sigma_east = sigma_north if measurement.sigma_east is None else measurement.sigma_east
        return Expectation(
            np.array([measurement.north, measurement.east]),
            mean[[north, east]] + swing,
            jacobian,
            np.diag([sigma_north**2, sigma_east**2]),
        )
