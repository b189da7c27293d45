"""What is published: the belief at the horizon, carried to now and put into the words of an Estimate."""

from __future__ import annotations

import math
from typing import Any

from filters.belief import Displacement, Moments
from filters.motion.constant_velocity import DOWN, VELOCITY_DOWN, VELOCITY_EAST, VELOCITY_NORTH
from filters.particle import ParticleFilter
from service.estimate import Estimate, Hypotheses, Triangle, Triple
from service.estimator.carrier import Pose
from service.estimator.dispute import Dispute
from service.estimator.hypotheses import Tracker
from service.estimator.lasting import Lasting
from service.estimator.leading import Leading
from service.estimator.places import places
from service.estimator.vehicle import Vehicle
from service.geodesy import LocalFrame

PUBLISHED = frozenset({"north", "east", "heading", DOWN, VELOCITY_NORTH, VELOCITY_EAST, VELOCITY_DOWN})
"""Dimensions that have fields of their own; the others are slow states."""

UNKNOWN: Triple = (None, None, None)
UNKNOWN_TRIANGLE: Triangle = (None, None, None, None, None, None)


class Output:
    """Carries moments from the belief's time to now and writes them down.

    With a ``tracker`` they are the leading hypothesis's (:mod:`service.estimator.leading`), with ``lasting`` they are
    as wide as a receiver's lasting error makes them.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        belief: ParticleFilter[Any],
        tracker: Tracker | None = None,
        lasting: Lasting | None = None,
        dispute: Dispute | None = None,
    ) -> None:
        self._vehicle = vehicle
        self._belief = belief
        self._tracker = tracker
        self._lasting = lasting
        self._dispute = dispute
        self._pose: Pose | None = None
        self._leading = None if tracker is None else Leading(belief, tracker)
        self._carrier = vehicle.carrier(belief if self._leading is None else self._leading)

    @property
    def displacement(self) -> Displacement | None:
        """Of the last :meth:`at`; the cloud is carried by the same."""
        return self._carrier.displacement

    def at(self, belief_time: int, now: int) -> Pose:
        """Return the belief carried from ``belief_time`` to ``now`` (nanoseconds)."""
        pose = self._carrier.at(belief_time, now)
        if self._leading is not None:
            pose = self._leading.honest(pose, self._carrier.displacement)
        if self._lasting is not None:
            pose = self._lasting.widened(pose)
        if self._dispute is not None and self._dispute.held.any():
            pose = pose.wider(self._dispute.held)
        self._pose = pose
        return pose

    def hypotheses(self, unix: float) -> Hypotheses | None:
        """Write the hypotheses of the last :meth:`at` down, with the Unix time (s) that it was for."""
        if self._pose is None:
            return None
        found = [] if self._leading is None else self._leading.hypotheses
        name = 1 if self._tracker is None else self._tracker.leader
        return places(unix, self._pose, found, name)

    def estimate(self, pose: Pose | None, frame: LocalFrame | None, **figures: Any) -> Estimate:
        """Write ``pose`` down; ``figures`` are the fields of :class:`Estimate` that the belief does not know."""
        if pose is None:
            return Estimate(
                position=UNKNOWN,
                velocity=UNKNOWN,
                heading=None,
                position_covariance=UNKNOWN_TRIANGLE,
                velocity_covariance=UNKNOWN_TRIANGLE,
                heading_variance=None,
                latitude=None,
                longitude=None,
                altitude=None,
                radius95=None,
                hypotheses=0,
                particles=0,
                effective_sample_size=None,
                biases={},
                **figures,
            )
        north, east = pose.mean("north"), pose.mean("east")
        sampled = math.isfinite(pose.moments.effective_sample_size)
        nn, ne, ee = (float(pose.covariance[i, j]) for i, j in ((0, 0), (0, 1), (1, 1)))
        down, dd, nd, ed = (None, None, None, None) if pose.down is None else pose.down
        heading, heading_variance = (None, None) if pose.heading is None else pose.heading
        latitude, longitude, altitude = self._geodetic(frame, north, east, down)
        return Estimate(
            position=(north, east, down),
            velocity=pose.velocity,
            heading=heading,
            position_covariance=(nn, ne, nd, ee, ed, dd),
            velocity_covariance=pose.velocity_covariance,
            heading_variance=heading_variance,
            latitude=latitude,
            longitude=longitude,
            altitude=altitude,
            radius95=pose.radius95,
            hypotheses=self._tracker.count if sampled and self._tracker is not None else 1,
            particles=self._belief.count if sampled else 0,
            effective_sample_size=pose.moments.effective_sample_size if sampled else None,
            biases=self._slow_states(pose.moments) | self._vehicle.height_biases,
            **figures,
        )

    @staticmethod
    def _geodetic(frame: LocalFrame | None, north: float, east: float, down: float | None) -> Triple:
        if frame is None:
            return UNKNOWN
        point = frame.geodetic_from_ned(north, east, 0.0 if down is None else down)
        return (
            math.degrees(point.latitude),
            math.degrees(point.longitude),
            None if down is None else point.altitude,
        )

    @staticmethod
    def _slow_states(moments: Moments) -> dict[str, tuple[float, float]]:
        return {
            name: (float(moments.mean[i]), math.sqrt(max(0.0, float(moments.variance[i]))))
            for i, name in enumerate(moments.names)
            if name not in PUBLISHED
        }
