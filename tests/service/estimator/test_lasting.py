"""A latency that is known to some hundredths of a second makes the region wider along the way, and nowhere else."""

from __future__ import annotations

import math

import numpy as np
import pytest

from filters.belief import Evidence, Moments
from filters.sensing import Position, PositionMeasurement
from service.estimator.carrier import Pose
from service.estimator.lasting import Lasting
from service.estimator.measuring import Measurement


def pose(north: float, east: float) -> Pose:
    """A belief of 0.1 m that moves so fast."""
    covariance = np.diag([0.01, 0.01, 1e-4])
    moments = Moments(("north", "east", "heading"), np.zeros(3), covariance.diagonal(), covariance, 100.0)
    return Pose(
        moments, covariance, (0.0, 1e-4), None, (north, east, None), (0.0, 0.0, None, 0.0, None, None), 0.245
    )


def fix(timing: float) -> Measurement:
    value = PositionMeasurement(0.0, 0.0, 0.3)
    return Measurement("position/l", Position(0.3), value, True, math.log(1e-8), 1.0, 0.0, True, timing)


def test_the_region_is_wider_along_the_way_by_what_the_latency_is_off() -> None:
    lasting = Lasting()
    assert lasting.widened(pose(3.0, 4.0)).covariance is not None
    lasting.weighed(0, fix(0.02), Evidence(0.0, 0.0, True), False)
    wide = lasting.widened(pose(3.0, 4.0))
    along, across = np.array([0.6, 0.8]), np.array([-0.8, 0.6])
    assert along @ wide.covariance[:2, :2] @ along == pytest.approx(0.01 + 0.1**2)
    assert across @ wide.covariance[:2, :2] @ across == pytest.approx(0.01)
    assert wide.radius95 > 0.245
    standing = lasting.widened(pose(0.0, 0.0))
    np.testing.assert_array_equal(standing.covariance, pose(0.0, 0.0).covariance)


def test_a_fix_whose_stamp_is_its_own_widens_nothing_and_a_new_beginning_forgets() -> None:
    lasting = Lasting()
    lasting.weighed(0, fix(0.0), Evidence(0.0, 0.0, True), False)
    assert lasting.widened(pose(3.0, 4.0)).radius95 == 0.245
    lasting.weighed(0, fix(0.02), Evidence(0.0, 0.0, True), True)
    assert lasting.widened(pose(3.0, 4.0)).radius95 == 0.245
    lasting.weighed(0, fix(0.02), Evidence(0.0, 0.0, True), False)
    lasting.started(0)
    assert lasting.widened(pose(3.0, 4.0)).radius95 == 0.245
