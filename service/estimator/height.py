"""Height where the belief leaves it out: a random walk of its own, in a Kalman filter of one dimension.

It is corrected by whatever fix brings an altitude; ranges need it, and it comes out with an honest variance.
"""

from __future__ import annotations

import numpy as np

from drivers.sample import AnyReading, GeodeticPosition, LocalPosition
from filters.kalman import KalmanFilter
from filters.motion.constant_velocity import DOWN
from service.config import Configuration
from service.estimator.start import Anchor
from service.geodesy import LocalFrame

CLIMB = 0.05
"""m per √s; how fast the height wanders, uncorrected."""


def height_state(configuration: Configuration) -> str | None:
    """Return the name of the state that is the vehicle's down, or ``None`` where a filter of its own keeps it.

    A tag's particles have it: in three dimensions, and on the plane unless position fixes bring altitudes.
    """
    if configuration.vehicle.motion != "constant_velocity":
        return None
    fixes = any(sensor.kind == "position" for sensor in configuration.sensor)
    return None if fixes and configuration.motion.dimensions == 2 else DOWN


class Height:
    """Down and its variance, or nothing while neither a start nor a fix has brought any."""

    def __init__(self) -> None:
        self._belief: KalmanFilter | None = None

    def begin(self, anchor: Anchor | None) -> None:
        """Begin anew where ``anchor`` has it, if it does."""
        self._belief = None
        if anchor is not None and anchor.position[2] is not None:
            self._belief = KalmanFilter(np.array([anchor.position[2]]), np.array([[anchor.sigma[2] ** 2]]))

    def wander(self, duration: float) -> None:
        """Let ``duration`` seconds pass."""
        if self._belief is not None:
            self._belief.predict(np.eye(1), np.array([[CLIMB**2 * duration]]))

    def correct(self, down: float, variance: float) -> None:
        """Weigh in a measured down (m, m²); the first one is a beginning."""
        if self._belief is None:
            self._belief = KalmanFilter(np.array([down]), np.array([[variance]]))
        else:
            self._belief.correct(np.array([down]), np.eye(1), np.array([[variance]]))

    @property
    def moments(self) -> tuple[float, float] | None:
        """Down (m) and its variance (m²), or ``None`` while unknown."""
        if self._belief is None:
            return None
        return float(self._belief.mean[0]), float(self._belief.covariance[0, 0])

    @property
    def down(self) -> float:
        """Down, or the origin's own height while unknown."""
        return 0.0 if self._belief is None else float(self._belief.mean[0])


def down_of(reading: AnyReading, frame: LocalFrame | None) -> tuple[float, float] | None:
    """Return the down (m) and its standard deviation that a position reading says, or ``None``."""
    if isinstance(reading, GeodeticPosition) and reading.altitude is not None and frame is not None:
        sigma = reading.sigma_vertical or 2.0 * (reading.sigma_horizontal or 3.0)
        return frame.origin.altitude - reading.altitude, sigma
    if isinstance(reading, LocalPosition) and reading.down is not None:
        return reading.down, reading.sigma_vertical or 2.0 * (reading.sigma_horizontal or 1.0)
    return None
