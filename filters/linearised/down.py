"""Down linearised: it is linear."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from filters.kalman import Expectation, Matrix
from filters.sensing.down import Down, DownMeasurement


class LinearisedDown:
    """A height, where the state has one.

    Parameters
    ----------
    sensor : Down
        Whose sigma is used.
    """

    def __init__(self, sensor: Down) -> None:
        self.sensor = sensor

    def expect(self, rows: Mapping[str, int], mean: Matrix, measurement: DownMeasurement) -> Expectation:
        """Linearise a height at ``mean``; see :class:`filters.extended_kalman.LinearisedSensor`."""
        row = rows[self.sensor.column]
        jacobian = np.zeros((1, mean.size))
        jacobian[0, row] = 1.0
        sigma = self.sensor.sigma if measurement.sigma is None else measurement.sigma
        return Expectation(
            np.array([measurement.down]), mean[row : row + 1].copy(), jacobian, np.array([[sigma**2]])
        )
