"""Distance and direction of a landmark from the mean of a Gaussian belief, with their derivatives."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from filters.kalman import Matrix

Pose = tuple[float, float, float]


def sighted(
    rows: Mapping[str, int], mean: Matrix, place: Callable[[Pose], tuple[float, float]]
) -> tuple[Matrix, Matrix]:
    """Return the expected distance and bearing, (2,), and their derivatives by the state, (2, n).

    Parameters
    ----------
    place : callable
        Where the landmark stands, given the pose (north, east, heading) that it is seen from.
    """
    row = rows["north"], rows["east"], rows["heading"]
    pose = float(mean[row[0]]), float(mean[row[1]]), float(mean[row[2]])
    landmark = place(pose)
    north, east = landmark[0] - pose[0], landmark[1] - pose[1]
    square = north**2 + east**2
    distance = math.sqrt(square)
    jacobian = np.zeros((2, mean.size))
    jacobian[1, row[2]] = -1.0
    if square > 0.0:
        jacobian[0, row[0]], jacobian[0, row[1]] = -north / distance, -east / distance
        jacobian[1, row[0]], jacobian[1, row[1]] = east / square, -north / square
    return np.array([distance, math.atan2(east, north) - pose[2]]), jacobian
