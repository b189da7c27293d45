"""Heading linearised: it is linear, but for the circle that its innovation lies on."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from filters.kalman import Expectation, Matrix
from filters.sensing.heading import Heading, HeadingMeasurement


class LinearisedHeading:
    """Heading, with a bias if the sensor names one.

    Parameters
    ----------
    sensor : Heading
        Whose sigma and bias are used.
    """

    def __init__(self, sensor: Heading) -> None:
        self.sensor = sensor

    def expect(self, rows: Mapping[str, int], mean: Matrix, measurement: HeadingMeasurement) -> Expectation:
        """Linearise a heading at ``mean``; see :class:`filters.extended_kalman.LinearisedSensor`."""
        jacobian = np.zeros((1, mean.size))
        jacobian[0, rows["heading"]] = 1.0
        if self.sensor.bias is not None:
            jacobian[0, rows[self.sensor.bias]] = 1.0
        sigma = self.sensor.sigma if measurement.sigma is None else measurement.sigma
        return Expectation(
            np.array([measurement.heading]), jacobian @ mean, jacobian, np.array([[sigma**2]]), angles=(0,)
        )
