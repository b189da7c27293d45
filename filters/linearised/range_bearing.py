"""Range and bearing linearised: the measurement update of Tables 7.2 and 7.3 of *Probabilistic Robotics*.

With (n, e) the way to the landmark and r its length, the derivatives by the position are -(n, e)/r of the distance and
(e, -n)/r² of the bearing, whose derivative by the heading is -1. A landmark without a name is taken for the likeliest,
by the sensor's own noise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from filters.kalman import Expectation, Matrix
from filters.linearised.sight import sighted
from filters.sensing.range_bearing import RangeBearing, RangeBearingMeasurement


class LinearisedRangeBearing:
    """Distance and direction of a landmark; of one without a name, the likeliest seen from the mean.

    Parameters
    ----------
    sensor : RangeBearing
        Whose sigmas and map are used.
    """

    def __init__(self, sensor: RangeBearing) -> None:
        self.sensor = sensor

    def expect(
        self, rows: Mapping[str, int], mean: Matrix, measurement: RangeBearingMeasurement
    ) -> Expectation:
        """Linearise a sight at ``mean``; see :class:`filters.extended_kalman.LinearisedSensor`.

        At the landmark itself there is no direction: the derivatives by the position are taken as 0 there.
        """
        expected, jacobian = sighted(rows, mean, lambda pose: self.sensor.place(pose, measurement))
        return Expectation(
            np.array([measurement.distance, math.remainder(measurement.bearing, 2.0 * math.pi)]),
            expected,
            jacobian,
            np.diag(np.square(self.sensor.sigmas(measurement)) / measurement.share),
            angles=(1,),
        )
