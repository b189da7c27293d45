"""The published moments of several hypotheses against sums over all particles."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from filters.belief import Displacement
from service.estimator.carrier import Pose
from service.estimator.leading import Leading
from service.estimator.places import places
from tests.service.estimator.images import images, shift, tracked

UNKNOWN = (None, None, None)
TRIANGLE = (None, None, None, None, None, None)


def test_the_mean_is_the_leader_s_and_the_covariance_that_of_all_about_it() -> None:
    belief = images()
    shift(belief, 0.5)
    leading = Leading(belief, tracked(belief))
    moments = leading.moments()
    weights = belief.weights / belief.weights.sum(dtype=np.float64)
    columns = np.stack([belief.column(name) for name in belief.names]).astype(np.float64)
    own = columns[1] < 7.0
    mean: NDArray[np.float64] = columns[:, own] @ weights[own] / weights[own].sum()
    np.testing.assert_allclose(moments.mean, mean, atol=2e-4)
    away = columns - mean[:, None]
    square: NDArray[np.float64] = (away * weights) @ away.T
    np.testing.assert_allclose(moments.pose_covariance, square[:3, :3], atol=5e-3)
    np.testing.assert_allclose(moments.variance, np.diag(square), atol=5e-3)
    joint = leading.joint(("north", "gyro_bias"))
    np.testing.assert_allclose(joint.mean, mean[[0, 3]], atol=2e-4)
    np.testing.assert_allclose(joint.covariance, square[np.ix_([0, 3], [0, 3])], atol=5e-3)


def test_one_place_is_published_as_the_filter_has_it() -> None:
    """To the last bit: who does not need hypotheses pays with nothing."""
    shift_by = Displacement(0.2, 0.01, 0.05)
    one, other = images(share=0.0), images(share=0.0)
    moments, expected = Leading(one, tracked(one)).moments(shift_by), other.moments(shift_by)
    np.testing.assert_array_equal(moments.mean, expected.mean)
    np.testing.assert_array_equal(moments.pose_covariance, expected.pose_covariance)


@pytest.mark.parametrize(("odds", "least", "most"), [(1.0, 14.0, 15.0), (0.03, 0.5, 1.5)])
def test_the_radius_holds_95_percent_of_all(odds: float, least: float, most: float) -> None:
    """40 % elsewhere lies within it, 2 % need not."""
    belief = images()
    tracker = tracked(belief)
    shift(belief, odds)
    leading = Leading(belief, tracker)
    moments = leading.moments()
    pose = Pose(moments, moments.pose_covariance, None, None, UNKNOWN, TRIANGLE, 0.0)
    radius = leading.honest(pose, None).radius95
    assert least < radius < most
    distances = np.hypot(belief.column("north") - moments.mean[0], belief.column("east") - moments.mean[1])
    inside = float(belief.weights[distances <= radius].sum() / belief.weights.sum())
    assert abs(inside - 0.95) < 0.03  # of 1,024 particles, one standard deviation is 0.007


def test_what_the_way_adds_is_turned_with_each_hypothesis_s_own_heading() -> None:
    """One square metre is added along the leader's heading, north: along the other's, that is east."""
    belief = images(heading=np.pi / 2)
    leading = Leading(belief, tracked(belief))
    moments = leading.moments()
    added = np.zeros((3, 3))
    added[0, 0] = 1.0
    heading = (float(moments.mean[2]), 0.1)
    pose = Pose(moments, moments.pose_covariance + added, heading, None, UNKNOWN, TRIANGLE, 9.0)
    said = places(12.0, pose, leading.hypotheses, 1)
    first, second = said.hypotheses
    assert said.time == 12.0
    assert said.elsewhere == pytest.approx(0.0, abs=1e-9)
    assert first.weight + second.weight == pytest.approx(1.0)
    for one, nn, ee in ((first, 1.16, 0.09), (second, 0.16, 1.09)):
        assert one.position_covariance[0] == pytest.approx(nn, abs=0.02)
        assert one.position_covariance[3] == pytest.approx(ee, abs=0.02)
    only = places(12.0, pose, [], 7).hypotheses
    assert [(each.name, each.weight) for each in only] == [(7, 1.0)]
    assert only[0].position_covariance[0] == pytest.approx(pose.covariance[0, 0])
