"""Bearing: the direction to a landmark, seen from the nose.

    expected = atan2(e - east, n - north) - heading

with the landmark at (n, e); von Mises, with an outlier part uniform over the circle. Which landmark it was is known, or
marginalised over a map (:mod:`filters.sensing.landmark`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from numpy.typing import ArrayLike

from filters.particle_set import ParticleSet
from filters.sensing.landmark import (
    CIRCLE,
    Sight,
    check_association,
    checked,
    likeliest,
    log_von_mises_peak,
    share_refusal,
)
from filters.sensing.robust import check, mixture, sigma_refusal


class BearingMeasurement(NamedTuple):
    """A bearing, and where its landmark stands if it is known which one it is.

    Attributes
    ----------
    bearing : float
        Radians clockwise from the nose, any number of turns.
    north, east : float or None
        Of the landmark, metres; ``None``: it may be any of the map.
    sigma : float or None
        Standard deviation, radians, if the measurement says so.
    share : float
        What it is worth, of an independent sight, 0 to 1; less where the ones before had the same errors.
    """

    bearing: float
    north: float | None = None
    east: float | None = None
    sigma: float | None = None
    share: float = 1.0


class Bearing:
    """Direction of a landmark.

    Parameters
    ----------
    sigma : float
        Standard deviation, radians, of measurements that do not state their own.
    outliers : float
        Fraction of measurements that say nothing.
    landmarks : (landmark, 2) array, optional
        North and east of the landmarks that a measurement without a name may be of.

    Raises
    ------
    ValueError
        A parameter out of its range, or landmarks that are no such table.
    """

    def __init__(self, sigma: float, outliers: float = 0.05, landmarks: ArrayLike | None = None) -> None:
        check("bearing", sigma, outliers, CIRCLE)
        self.sigma = sigma
        self.outliers = outliers
        self.landmarks = checked("bearing", landmarks)

    def sight(self, measurement: BearingMeasurement) -> Sight:
        """Return a measurement in the kernels' terms."""
        sigma = self.sigma if measurement.sigma is None else measurement.sigma
        return Sight(0.0, math.inf, measurement.bearing, sigma)

    def refusal(self, measurement: BearingMeasurement) -> str | None:
        """Refuse a sigma or share out of its range, and a landmark without a name where there is no map."""
        return (
            sigma_refusal(measurement.sigma)
            or share_refusal(measurement.share)
            or check_association("bearing", measurement.north is not None, self.landmarks)
        )

    def weigh(self, particles: ParticleSet, first: int, last: int, measurement: BearingMeasurement) -> float:
        """Add the log likelihood of a bearing; see :class:`filters.sensing.Sensor`."""
        sigma = self.sigma if measurement.sigma is None else measurement.sigma
        mixed = mixture(self.outliers, log_von_mises_peak(sigma), -math.log(CIRCLE))
        sight, share = self.sight(measurement), measurement.share
        if measurement.north is None or measurement.east is None:
            sight.of_any(self.landmarks, particles, first, last, mixed, share)
        else:
            sight.of(measurement.north, measurement.east, particles, first, last, mixed, share)
        return share * mixed.log_peak

    def place(self, pose: tuple[float, float, float], measurement: BearingMeasurement) -> tuple[float, float]:
        """Return where the landmark stands: as said, or the likeliest of the map seen from ``pose``."""
        if measurement.north is None or measurement.east is None:
            return likeliest(self.landmarks, pose, self.sight(measurement))
        return measurement.north, measurement.east

    def innovation(self, centre: Mapping[str, float], measurement: BearingMeasurement) -> float:
        """Measured less expected bearing at the centre, radians in [-pi, pi]."""
        pose = centre["north"], centre["east"], centre["heading"]
        north, east = self.place(pose, measurement)
        direction = math.atan2(east - pose[1], north - pose[0])
        return math.remainder(measurement.bearing - (direction - pose[2]), CIRCLE)
