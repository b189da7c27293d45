"""Position linearised: the identity in north and east, and the lever's swing in the heading."""

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
        forward, right = self.sensor.lever
        sine, cosine = math.sin(mean[heading]), math.cos(mean[heading])
        swing = np.array([forward * cosine - right * sine, forward * sine + right * cosine])
        jacobian = np.zeros((2, mean.size))
        jacobian[0, north] = jacobian[1, east] = 1.0
        jacobian[:, heading] = (-swing[1], swing[0])
        sigma_north = self.sensor.sigma if measurement.sigma_north is None else measurement.sigma_north
        sigma_east = sigma_north if measurement.sigma_east is None else measurement.sigma_east
        return Expectation(
            np.array([measurement.north, measurement.east]),
            mean[[north, east]] + swing,
            jacobian,
            np.diag([sigma_north**2, sigma_east**2]),
        )
