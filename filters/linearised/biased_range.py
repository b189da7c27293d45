"""Range with a bias per beacon, linearised: the unit vector from the beacon times the scale, and 1 for the bias.

At the beacon itself there is no direction; the derivative by the position is taken as 0 there, and the range says
nothing of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from filters.kalman import Expectation, Matrix
from filters.sensing.biased_range import BiasedRange, BiasedRangeMeasurement


class LinearisedBiasedRange:
    """Range to a beacon, with the scale, bias and height that the sensor names.

    Parameters
    ----------
    sensor : BiasedRange
        Whose sigma and states are used; a Gaussian has no tail.
    """

    def __init__(self, sensor: BiasedRange) -> None:
        self.sensor = sensor

    def expect(
        self, rows: Mapping[str, int], mean: Matrix, measurement: BiasedRangeMeasurement
    ) -> Expectation:
        """Linearise a range at ``mean``; see :class:`filters.extended_kalman.LinearisedSensor`."""
        sensor = self.sensor
        down = 0.0 if sensor.height is None else float(mean[rows[sensor.height]])
        away = (
            float(mean[rows["north"]]) - measurement.north,
            float(mean[rows["east"]]) - measurement.east,
            down - measurement.down_difference,
        )
        distance = math.hypot(*away)
        scale = 1.0 if sensor.scale is None else float(mean[rows[sensor.scale]])
        bias = sensor.bias_of(measurement)
        expected = scale * distance + (0.0 if bias is None else float(mean[rows[bias]]))
        jacobian = np.zeros((1, mean.size))
        names = ("north", "east", sensor.height)
        if distance > 0.0:
            for name, component in zip(names, away, strict=True):
                if name is not None:
                    jacobian[0, rows[name]] = scale * component / distance
        if sensor.scale is not None:
            jacobian[0, rows[sensor.scale]] = distance
        if bias is not None:
            jacobian[0, rows[bias]] = 1.0
        sigma = sensor.sigma if measurement.sigma is None else measurement.sigma
        return Expectation(
            np.array([measurement.distance]), np.array([expected]), jacobian, np.array([[sigma**2]])
        )
