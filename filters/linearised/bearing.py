"""Bearing linearised: the direction to a landmark whose place is known, seen from the nose.

    expected = atan2(east_b - east, north_b - north) - heading

With (n, e) the way to the landmark and r² = n² + e², its derivatives are e/r², -n/r² and -1.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from filters.kalman import Expectation, Matrix


class BearingMeasurement(NamedTuple):
    """A bearing, and where its landmark stands.

    Attributes
    ----------
    bearing : float
        Radians clockwise from the nose, any number of turns.
    north, east : float
        Of the landmark, metres.
    sigma : float or None
        Standard deviation, radians, if the measurement says so.
    """

    bearing: float
    north: float
    east: float
    sigma: float | None = None


class LinearisedBearing:
    """Bearing of a landmark.

    Parameters
    ----------
    sigma : float
        Standard deviation, radians, of measurements that do not state their own.

    Raises
    ------
    ValueError
        A sigma that is not positive and finite.
    """

    def __init__(self, sigma: float) -> None:
        if not 0.0 < sigma < math.inf:
            raise ValueError(f"bearing: sigma must be positive and finite, got {sigma}")
        self.sigma = sigma

    def expect(self, rows: Mapping[str, int], mean: Matrix, measurement: BearingMeasurement) -> Expectation:
        """Linearise a bearing at ``mean``; see :class:`filters.extended_kalman.LinearisedSensor`.

        At the landmark itself there is no direction: the derivatives by the position are taken as 0 there.
        """
        north = measurement.north - float(mean[rows["north"]])
        east = measurement.east - float(mean[rows["east"]])
        square = north**2 + east**2
        jacobian = np.zeros((1, mean.size))
        jacobian[0, rows["heading"]] = -1.0
        if square > 0.0:
            jacobian[0, rows["north"]] = east / square
            jacobian[0, rows["east"]] = -north / square
        expected = math.atan2(east, north) - float(mean[rows["heading"]])
        sigma = self.sigma if measurement.sigma is None else measurement.sigma
        return Expectation(
            np.array([measurement.bearing]),
            np.array([expected]),
            jacobian,
            np.array([[sigma**2]]),
            angles=(0,),
        )
