"""Range linearised: the derivative of scale · distance + bias is the unit vector from the beacon, times the scale.

At the beacon itself there is no direction; the derivative by the position is taken as 0 there, and the range says
nothing of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from filters.kalman import Expectation, Matrix
from filters.sensing.range import Range, RangeMeasurement


class LinearisedRange:
    """Range to a beacon, with scale and bias if the sensor names them.

    Parameters
    ----------
    sensor : Range
        Whose sigma, scale and bias are used.
    """

    def __init__(self, sensor: Range) -> None:
        self.sensor = sensor

    def expect(self, rows: Mapping[str, int], mean: Matrix, measurement: RangeMeasurement) -> Expectation:
        """Linearise a range at ``mean``; see :class:`filters.extended_kalman.LinearisedSensor`."""
        sensor = self.sensor
        north = float(mean[rows["north"]]) - measurement.north
        east = float(mean[rows["east"]]) - measurement.east
        distance = math.hypot(north, east, measurement.down_difference)
        scale = 1.0 if sensor.scale is None else float(mean[rows[sensor.scale]])
        expected = scale * distance + (0.0 if sensor.bias is None else float(mean[rows[sensor.bias]]))
        jacobian = np.zeros((1, mean.size))
        if distance > 0.0:
            jacobian[0, rows["north"]] = scale * north / distance
            jacobian[0, rows["east"]] = scale * east / distance
        if sensor.scale is not None:
            jacobian[0, rows[sensor.scale]] = distance
        if sensor.bias is not None:
            jacobian[0, rows[sensor.bias]] = 1.0
        sigma = sensor.sigma if measurement.sigma is None else measurement.sigma
        return Expectation(
            np.array([measurement.distance]), np.array([expected]), jacobian, np.array([[sigma**2]])
        )
