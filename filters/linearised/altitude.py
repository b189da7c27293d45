"""Altitude linearised: it is linear."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from filters.kalman import Expectation, Matrix
from filters.sensing.altitude import Altitude, AltitudeMeasurement


class LinearisedAltitude:
    """An altitude above the origin, with a bias if the sensor names one.

    Parameters
    ----------
    sensor : Altitude
        Whose sigma and bias are used.
    """

    def __init__(self, sensor: Altitude) -> None:
        self.sensor = sensor

    def expect(self, rows: Mapping[str, int], mean: Matrix, measurement: AltitudeMeasurement) -> Expectation:
        """Linearise an altitude at ``mean``; see :class:`filters.extended_kalman.LinearisedSensor`."""
        jacobian = np.zeros((1, mean.size))
        jacobian[0, rows[self.sensor.column]] = -1.0
        if self.sensor.bias is not None:
            jacobian[0, rows[self.sensor.bias]] = 1.0
        return Expectation(
            np.array([measurement.altitude]),
            jacobian @ mean,
            jacobian,
            np.array([[self.sensor.spread(measurement) ** 2]]),
        )
