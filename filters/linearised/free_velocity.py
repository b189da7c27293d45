"""Velocity of a vehicle whose velocity is a state: linear as it is."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from filters.kalman import Expectation, Matrix
from filters.motion.constant_velocity import VELOCITY_EAST, VELOCITY_NORTH
from filters.sensing.free_velocity import FreeVelocity, FreeVelocityMeasurement


class LinearisedFreeVelocity:
    """Horizontal velocity.

    Parameters
    ----------
    sensor : FreeVelocity
        Whose sigma is used; what a particle's path leaves open of its velocity is in the covariance.
    """

    def __init__(self, sensor: FreeVelocity) -> None:
        self.sensor = sensor

    def expect(
        self, rows: Mapping[str, int], mean: Matrix, measurement: FreeVelocityMeasurement
    ) -> Expectation:
        """Say what is expected at ``mean``; see :class:`filters.extended_kalman.LinearisedSensor`."""
        places = [rows[VELOCITY_NORTH], rows[VELOCITY_EAST]]
        jacobian = np.zeros((2, mean.size))
        jacobian[[0, 1], places] = 1.0
        sigma = self.sensor.sigma if measurement.sigma is None else measurement.sigma
        return Expectation(
            np.array([measurement.north, measurement.east]), mean[places], jacobian, sigma**2 * np.eye(2)
        )
