"""The belief as it is spoken for: the leading hypothesis, with an uncertainty that is honest for all of it.

The mean of several hypotheses lies where none of them is, and one's own covariance keeps silent about the others. So
the mean is the leader's, and variances and covariances are the mean squares of the whole belief's differences from
there: its covariance, and the square of the way from the leader's mean to its own (the law of total variance).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from filters.belief import STILL, Displacement, Joint, Moments
from filters.labelled_moments import Hypothesis
from filters.particle import ParticleFilter
from service.estimator.carrier import Pose
from service.estimator.hypotheses import Tracker

CLOUD = 1024
"""Particles that the radius is taken from, evenly spaced among all."""

WITHIN = 0.95
REACH = 1.96
"""Standard deviations to either side that hold as much of a normal number."""


class Leading:
    """A :class:`~filters.belief.Belief`: the particle filter's own while there is one hypothesis."""

    def __init__(self, belief: ParticleFilter[Any], tracker: Tracker) -> None:
        self._belief = belief
        self._tracker = tracker
        self._cloud = np.zeros((CLOUD, 4), np.float32)
        self.hypotheses: list[Hypothesis] = []
        """Of the last :meth:`moments`, the leader first; none while there is one."""

    @property
    def names(self) -> tuple[str, ...]:
        """Its dimensions."""
        return self._belief.names

    def moments(self, displacement: Displacement | None = None) -> Moments:
        """Say the leader's mean, and the mean squares about it."""
        whole = self._belief.moments(displacement)
        self.hypotheses = self._tracker.extract(STILL if displacement is None else displacement)
        if not self.hypotheses:
            self._tracker.spoken(whole.mean, math.sqrt(float(whole.variance[:2].max())))
            return whole
        leader = self.hypotheses[0]
        mean = leader.mean
        self._tracker.spoken(mean, math.sqrt(float(leader.variance[:2].max())))
        away = whole.mean - mean
        away[2] = math.remainder(float(away[2]), math.tau)
        return Moments(
            whole.names,
            mean,
            whole.pose_covariance + np.outer(away[:3], away[:3]),
            whole.variance + away**2,
            whole.effective_sample_size,
        )

    def joint(self, names: Sequence[str]) -> Joint:
        """Say the same of some dimensions together."""
        whole = self._belief.joint(names)
        hypotheses = self._tracker.extract(STILL)
        if not hypotheses:
            return whole
        mean = hypotheses[0].mean[[self.names.index(name) for name in names]]
        away = whole.mean - mean
        return Joint(whole.names, mean, whole.covariance + np.outer(away, away))

    def honest(self, pose: Pose, displacement: Displacement | None) -> Pose:
        """Return ``pose``, with the radius about the leader's mean that holds 95 % of all particles.

        What the way from the horizon to now adds to the particles' spread is added to it as to a standard deviation.
        """
        if not self.hypotheses:
            return pose
        cloud = self._belief.cloud(CLOUD, displacement, self._cloud)
        radius = _radius(cloud, pose.moments.mean)
        before = pose.moments.pose_covariance
        added = sum(float(pose.covariance[i, i]) - float(before[i, i]) for i in range(2))
        return pose._replace(radius95=math.hypot(radius, REACH * math.sqrt(max(0.0, added))))


def _radius(cloud: NDArray[np.float32], mean: NDArray[np.float64]) -> float:
    """Return the distance from the mean within which 95 % of the weight lies."""
    distances = np.hypot(cloud[:, 0] - mean[0], cloud[:, 1] - mean[1])
    order = np.argsort(distances, kind="stable")
    gathered = np.cumsum(cloud[order, 3], dtype=np.float64)
    place = int(np.searchsorted(gathered, WITHIN * float(gathered[-1])))
    return float(distances[order[min(place, len(order) - 1)]])
