"""Range and bearing of a landmark: what a camera, a radar or a scanner with markers sees from the nose.

    expected = (√((n - north)² + (e - east)²),  atan2(e - east, n - north) - heading)

with the landmark at (n, e): the landmark model of *Probabilistic Robotics* (6.6, Table 6.4) without a signature. The
distance is normal, the bearing von Mises, and the whole has an outlier part. Which landmark it was is known, or
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

_LOG_SQRT_TWO_PI = 0.5 * math.log(2.0 * math.pi)


class RangeBearingMeasurement(NamedTuple):
    """A landmark seen, and where it stands if it is known which one it is.

    Attributes
    ----------
    distance : float
        Metres.
    bearing : float
        Radians clockwise from the nose, any number of turns.
    north, east : float or None
        Of the landmark, metres; ``None``: it may be any of the map.
    sigma_distance, sigma_bearing : float or None
        Standard deviations, metres and radians, if the measurement says so.
    share : float
        What it is worth, of an independent sight, 0 to 1; less where the ones before had the same errors.
    """

    distance: float
    bearing: float
    north: float | None = None
    east: float | None = None
    sigma_distance: float | None = None
    sigma_bearing: float | None = None
    share: float = 1.0


class RangeBearing:
    """Distance and direction of a landmark, with an outlier part uniform over ``span`` metres and the circle.

    Parameters
    ----------
    sigma_distance, sigma_bearing : float
        Standard deviations, metres and radians, of measurements that do not state their own.
    outliers : float
        Fraction of measurements that say nothing.
    span : float
        How widely the distances of outliers scatter, metres.
    landmarks : (landmark, 2) array, optional
        North and east of the landmarks that a measurement without a name may be of.

    Raises
    ------
    ValueError
        A parameter out of its range, or landmarks that are no such table.
    """

    def __init__(
        self,
        sigma_distance: float,
        sigma_bearing: float,
        outliers: float = 0.05,
        span: float = 50.0,
        landmarks: ArrayLike | None = None,
    ) -> None:
        check("range_bearing", sigma_distance, outliers, span)
        check("range_bearing", sigma_bearing, outliers, CIRCLE)
        self.sigma_distance = sigma_distance
        self.sigma_bearing = sigma_bearing
        self.outliers = outliers
        self.span = span
        self.landmarks = checked("range_bearing", landmarks)

    def sigmas(self, measurement: RangeBearingMeasurement) -> tuple[float, float]:
        """Return the standard deviations of a measurement: its own, or the model's."""
        distance, bearing = measurement.sigma_distance, measurement.sigma_bearing
        return (
            self.sigma_distance if distance is None else distance,
            self.sigma_bearing if bearing is None else bearing,
        )

    def sight(self, measurement: RangeBearingMeasurement) -> Sight:
        """Return a measurement in the kernels' terms."""
        sigma_distance, sigma_bearing = self.sigmas(measurement)
        return Sight(measurement.distance, sigma_distance, measurement.bearing, sigma_bearing)

    def refusal(self, measurement: RangeBearingMeasurement) -> str | None:
        """Refuse a distance, sigma or share out of its range, and a landmark without a name where there is no map."""
        if not measurement.distance > 0.0:
            return f"distance must be positive, got {measurement.distance:g} m"
        return (
            sigma_refusal(measurement.sigma_distance)
            or sigma_refusal(measurement.sigma_bearing)
            or share_refusal(measurement.share)
            or check_association("range_bearing", measurement.north is not None, self.landmarks)
        )

    def weigh(
        self, particles: ParticleSet, first: int, last: int, measurement: RangeBearingMeasurement
    ) -> float:
        """Add the log likelihood of a landmark seen; see :class:`filters.sensing.Sensor`."""
        sigma_distance, sigma_bearing = self.sigmas(measurement)
        log_density = log_von_mises_peak(sigma_bearing) - math.log(sigma_distance) - _LOG_SQRT_TWO_PI
        mixed = mixture(self.outliers, log_density, -math.log(self.span * CIRCLE))
        sight, share = self.sight(measurement), measurement.share
        if measurement.north is None or measurement.east is None:
            sight.of_any(self.landmarks, particles, first, last, mixed, share)
        else:
            sight.of(measurement.north, measurement.east, particles, first, last, mixed, share)
        return share * mixed.log_peak

    def place(
        self, pose: tuple[float, float, float], measurement: RangeBearingMeasurement
    ) -> tuple[float, float]:
        """Return where the landmark stands: as said, or the likeliest of the map seen from ``pose``."""
        if measurement.north is None or measurement.east is None:
            return likeliest(self.landmarks, pose, self.sight(measurement))
        return measurement.north, measurement.east

    def innovation(self, centre: Mapping[str, float], measurement: RangeBearingMeasurement) -> float:
        """Measured less expected distance at the centre, metres; of the likeliest landmark, if it has no name."""
        pose = centre["north"], centre["east"], centre["heading"]
        north, east = self.place(pose, measurement)
        return measurement.distance - math.hypot(north - pose[0], east - pose[1])
