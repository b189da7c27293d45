"""The output predictor: a belief at the horizon, carried to now with the controls already received."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from filters.belief import Belief, Displacement, Moments
from filters.density.gaussian import radius
from filters.motion.prediction import process_covariance
from service.estimator.vehicle import Vehicle


class Pose(NamedTuple):
    """The belief at now: its moments, carried; ``covariance`` of (north, east, heading)."""

    moments: Moments
    covariance: NDArray[np.float64]
    speed: float
    speed_variance: float
    radius95: float

    def mean(self, name: str) -> float:
        """Return the mean of one column."""
        return float(self.moments.mean[self.moments.names.index(name)])


class Carrier:
    """Carries a belief's moments from its own time to now.

    Attributes
    ----------
    displacement : Displacement or None
        Of the last :meth:`at`; the cloud is carried by the same.
    """

    def __init__(self, vehicle: Vehicle, belief: Belief) -> None:
        self._vehicle = vehicle
        self._belief = belief
        self._biases = (0.0, 1.0)
        self.displacement: Displacement | None = None

    def at(self, belief_time: int, now: int) -> Pose:
        """Return the belief carried from ``belief_time`` to ``now`` (nanoseconds)."""
        displacement = self._vehicle.displacement(belief_time, now, self._biases)
        moments = self._belief.moments(displacement)
        index = moments.names.index
        self._biases = (
            float(moments.mean[index("gyro_bias")]),
            float(moments.mean[index("odometry_scale")]),
        )
        distance = math.hypot(displacement.forward, displacement.right)
        heading = float(moments.mean[index("heading")])
        noise = self._vehicle.noise(belief_time, now)
        covariance = moments.pose_covariance + process_covariance(
            distance, heading - 0.5 * displacement.turn, noise
        )
        self.displacement = displacement
        speed = self._vehicle.controls.speed(now) * self._biases[1]
        return Pose(
            moments, covariance, speed, self._vehicle.speed_variance(now), radius(covariance[:2, :2], 0.95)
        )
