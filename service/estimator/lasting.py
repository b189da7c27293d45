"""Widens what is published by what a receiver's lasting error may have done to the belief (:mod:`filters.consider`).

Where the lasting error is no state of the particles (:mod:`service.estimator.receivers`), they weigh fixes as if their
errors were new every second. Published is, beside the particles' own spread, the share of the mean that the receiver's
error of the last minute has, reckoned along with every absolute measurement.

A latency that was stated lasts longer still, and shifts all fixes by as much of the way as it is off. It is known to
some hundredths of a second, or better where the way has told it (:mod:`service.estimator.latency`). So much is the
region wider along the velocity.
"""

from __future__ import annotations

import math

import numpy as np

from drivers.sample import SECOND
from filters.belief import Evidence
from filters.consider import LastingError
from filters.sensing import PositionMeasurement
from service.estimator.carrier import Pose
from service.estimator.latency import Latency
from service.estimator.measuring import Measurement
from service.estimator.receivers import Receivers

DURATION = 60.0
"""Seconds over which reflections and atmosphere change what a receiver says."""

ONE_AXIS = 0.5
"""A measurement of one dimension (a range) corrects half of the plane."""


class Lasting:
    """A companion of the estimator: hears every measurement and every stretch, and widens the pose."""

    def __init__(self, receivers: Receivers | None = None, latency: Latency | None = None) -> None:
        self._receivers = receivers
        self._latency = latency
        self._error = LastingError(DURATION)
        self._variance = 0.0
        self._timing = 0.0

    def started(self, time: int) -> None:
        """Forget: the particles were drawn anew, with all that is unknown of their place."""
        self._error.restart()
        self._timing = 0.0

    def moved(self, start: int, end: int) -> None:
        """Let the receiver's error change."""
        self._error.wait((end - start) / SECOND)

    def weighed(self, time: int, measured: Measurement, evidence: Evidence, outlier: bool) -> None:
        """Reckon what a measurement of the place brought of it, or took away."""
        if outlier or not measured.absolute:
            return
        value = measured.value
        if isinstance(value, PositionMeasurement):
            self._timing = measured.timing if self._latency is None else self._latency.late(measured).sigma
            gain = self._gain(value.sigma_north or 0.0)
            known = self._receivers is not None and self._receivers.knows(measured)
            if measured.lasting > 0.0 and not known:
                self._error.corrected(gain, measured.lasting)
            else:
                self._error.displaced(gain)
        elif self._error.variance > 0.0:
            self._error.displaced(ONE_AXIS * self._gain(_sigma(measured)))

    def _gain(self, sigma: float) -> float:
        return self._variance / (self._variance + sigma * sigma) if self._variance > 0.0 else 0.0

    def widened(self, pose: Pose) -> Pose:
        """Return ``pose`` with the lasting error's variance on both axes; its own is what the next gains are of."""
        self._variance = 0.5 * float(pose.covariance[0, 0] + pose.covariance[1, 1])
        way = self._timing * np.array([pose.velocity[0] or 0.0, pose.velocity[1] or 0.0])
        added = self._error.variance * np.eye(2) + np.outer(way, way)
        return pose.wider(added) if added.any() else pose


def _sigma(measured: Measurement) -> float:
    """Return the standard deviation of a measurement as it says, or else as its model says."""
    claimed: float | None = getattr(measured.value, "sigma", None)
    usual: float = getattr(measured.model, "sigma", math.inf)
    return usual if claimed is None else claimed
