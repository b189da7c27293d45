"""The hypotheses as they go out: each with its own mean and covariance, carried to now like the estimate."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from filters.labelled_moments import Hypothesis as Found
from service.estimate import Hypotheses, Hypothesis
from service.estimator.carrier import Pose


def places(unix: float, pose: Pose, found: Sequence[Found], name: int) -> Hypotheses:
    """Write the hypotheses down.

    Parameters
    ----------
    unix : float
        The time they are for, Unix seconds.
    pose : Pose
        The whole belief at that time.
    found : sequence of Found
        The hypotheses of its particles, the leader first; none if there is but one.
    name : int
        Of the only one.
    """
    if not found:
        covariance = pose.covariance
        return Hypotheses(unix, [_one(name, 1.0, pose.moments.mean, covariance, pose, _heading(pose))])
    added = pose.covariance - pose.moments.pose_covariance
    leader = float(found[0].mean[2])
    written = [
        _one(
            each.name,
            each.weight,
            each.mean,
            each.covariance + _turned(added, float(each.mean[2]) - leader),
            pose,
            None if pose.heading is None else float(each.mean[2]),
        )
        for each in found
    ]
    return Hypotheses(unix, written, max(0.0, 1.0 - sum(each.weight for each in found)))


def _heading(pose: Pose) -> float | None:
    return None if pose.heading is None else pose.heading[0]


def _turned(covariance: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """Turn what the way to now adds: it lies along the heading, and each hypothesis has its own."""
    sine, cosine = math.sin(angle), math.cos(angle)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return turn @ covariance @ turn.T


def _one(
    name: int,
    weight: float,
    mean: NDArray[np.float64],
    covariance: NDArray[np.float64],
    pose: Pose,
    heading: float | None,
) -> Hypothesis:
    nn, ne, ee = (float(covariance[i, j]) for i, j in ((0, 0), (0, 1), (1, 1)))
    down, dd = (None, None) if pose.down is None else pose.down[:2]
    across = None if pose.down is None else 0.0
    return Hypothesis(
        name=name,
        weight=weight,
        position=(float(mean[0]), float(mean[1]), down),
        position_covariance=(nn, ne, across, ee, across, dd),
        heading=heading,
        heading_variance=None if heading is None else float(covariance[2, 2]),
    )
