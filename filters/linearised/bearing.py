"""Bearing linearised: the direction to a landmark, seen from the nose.

    expected = atan2(e - east, n - north) - heading

With (n, e) now the way to the landmark and r² = n² + e², its derivatives are e/r², -n/r² and -1.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from filters.kalman import Expectation, Matrix
from filters.linearised.sight import sighted
from filters.sensing.bearing import Bearing, BearingMeasurement


class LinearisedBearing:
    """Direction of a landmark; of one without a name, the likeliest seen from the mean.

    Parameters
    ----------
    sensor : Bearing
        Whose sigma and map are used.
    """

    def __init__(self, sensor: Bearing) -> None:
        self.sensor = sensor

    def expect(self, rows: Mapping[str, int], mean: Matrix, measurement: BearingMeasurement) -> Expectation:
        """Linearise a bearing at ``mean``; see :class:`filters.extended_kalman.LinearisedSensor`.

        At the landmark itself there is no direction: the derivatives by the position are taken as 0 there.
        """
        expected, jacobian = sighted(rows, mean, lambda pose: self.sensor.place(pose, measurement))
        sigma = self.sensor.sigma if measurement.sigma is None else measurement.sigma
        return Expectation(
            np.array([math.remainder(measurement.bearing, 2.0 * math.pi)]),
            expected[1:],
            jacobian[1:],
            np.array([[sigma**2 / measurement.share]]),
            angles=(0,),
        )
