"""Opening marginalised states again: moments stay, paths are forgotten, circles are left alone."""

from __future__ import annotations

import math

import numpy as np

from filters.motion.slow import RandomWalk
from filters.motion.unicycle import GYRO_BIAS, ODOMETRY_SCALE, Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.regularization import silverman
from filters.reopening import Columns, reopen

COUNT = 4000


def cloud(seed: int = 1) -> tuple[Columns, Columns]:
    """Return a pose and two states, one of them bound to it."""
    random = np.random.default_rng(seed)
    pose = np.array([[3.0], [2.0], [0.1]]) * random.standard_normal((3, COUNT)) + np.array(
        [[800.0], [-900.0], [0.5]]
    )
    own = random.standard_normal((2, COUNT)) * [[1e-3], [2e-2]]
    states = own + np.array([[2e-3 * (pose[2] - 0.5)], [1e-2 * (pose[0] - 800.0)]])[:, 0]
    return pose.astype(np.float32), (states + np.array([[0.005], [1.0]])).astype(np.float32)


def test_mean_variance_and_covariance_with_the_pose_stay() -> None:
    """Exactly, in the sample, up to single precision: the variance taken off the means is the one given back."""
    pose, states = cloud()
    opened = reopen(pose, states, COUNT / 2)
    assert opened is not None
    after = states - opened[0]
    assert np.allclose(after.mean(axis=1), states.mean(axis=1), rtol=1e-5)
    assert np.allclose(after.var(axis=1) + opened[1], states.var(axis=1), rtol=1e-3)
    around = pose.astype(np.float64) - pose.mean(axis=1, keepdims=True, dtype=np.float64)
    moved = around @ opened[0].T.astype(np.float64) / COUNT
    assert np.all(np.abs(moved) < 1e-3 * np.outer(pose.std(axis=1), states.std(axis=1)))


def test_what_is_given_back_is_the_residual_s_share() -> None:
    """Against least squares by numpy: h² of the variance that the pose leaves open."""
    pose, states = cloud(2)
    opened = reopen(pose, states, 1000.0)
    assert opened is not None
    columns = np.vstack([pose - pose.mean(axis=1, keepdims=True), np.ones(COUNT)]).T.astype(np.float64)
    squares = np.linalg.lstsq(columns, states.T.astype(np.float64), rcond=None)[1]
    assert np.allclose(opened[1], silverman(1000.0, 5) ** 2 * squares / COUNT, rtol=2e-3)


def test_headings_across_south_are_no_circle() -> None:
    """The same belief turned to where headings jump by a whole turn gives the same."""
    pose, states = cloud(3)
    turned = pose.copy()
    turned[2] = np.remainder(pose[2] - 0.5 + 2.0 * math.pi, 2.0 * math.pi) - math.pi
    straight, wrapped = reopen(pose, states, 500.0), reopen(turned, states, 500.0)
    assert straight is not None
    assert wrapped is not None
    assert np.allclose(straight[1], wrapped[1], rtol=1e-3)


def test_any_heading_leaves_all_as_it_was() -> None:
    """Where the heading could be any, no line goes through it."""
    pose, states = cloud(4)
    pose[2] = np.linspace(-3.1, 3.1, COUNT)
    assert reopen(pose, states, 500.0) is None


def test_copies_of_one_value_are_left_alone() -> None:
    """A set of one particle's copies has nothing to give back."""
    opened = reopen(np.ones((3, 8), np.float32), np.ones((2, 8), np.float32), 1.0)
    assert opened is not None
    assert not opened[1].any()


def test_a_filter_s_slow_states_keep_their_variance() -> None:
    """Through the filter: what moments say of bias and scale is the same before and after; P has grown."""
    motion = Unicycle(0.1, 0.02, 1e-4, 1e-4, 0.05, gyro_bias_sigma=0.01, odometry_scale_sigma=0.02)
    belief = ParticleFilter(motion, capacity=COUNT, seed=3)
    random = np.random.default_rng(5)
    start = {name: random.standard_normal(COUNT) for name in ("north", "east")}
    start |= {"heading": 0.1 * random.standard_normal(COUNT)}
    belief.initialize(start | {GYRO_BIAS: np.zeros(COUNT), ODOMETRY_SCALE: np.ones(COUNT)})
    for step in range(50):
        belief.predict(UnicycleControl(0.04 * step, 0.1), 0.1)
    belief.resample()
    before, left_open = belief.moments(), dict(motion.conditional_variances)
    belief.reopen(COUNT / 2)
    after = belief.moments()
    assert np.allclose(after.mean, before.mean, rtol=1e-4, atol=1e-4)
    slow = [after.names.index(name) for name in (GYRO_BIAS, ODOMETRY_SCALE)]
    assert np.allclose(after.variance[slow], before.variance[slow], rtol=1e-3)
    assert motion.conditional_variances[GYRO_BIAS] > 1.05 * left_open[GYRO_BIAS]
    assert motion.conditional_variances[ODOMETRY_SCALE] > 1.05 * left_open[ODOMETRY_SCALE]


def test_copies_of_a_sampled_state_come_apart() -> None:
    """Of twenty values among 4,000 copies: mean and variance stay, to four sigmas of the draws; no two are alike."""
    motion = Unicycle(0.1, 0.02, 1e-4, 1e-4)
    belief = ParticleFilter(motion, capacity=COUNT, seed=6, slow=[RandomWalk("delay", 0.0)])
    random = np.random.default_rng(8)
    start = {name: random.standard_normal(COUNT) for name in ("north", "east")}
    few = np.repeat(random.standard_normal(20), COUNT // 20)
    belief.initialize(
        start
        | {
            "heading": np.zeros(COUNT),
            GYRO_BIAS: np.zeros(COUNT),
            ODOMETRY_SCALE: np.ones(COUNT),
            "delay": few,
        }
    )
    before = belief.column("delay").copy()
    belief.reopen(100.0)
    after = belief.column("delay")
    four_sigmas = 4.0 * float(few.std()) / COUNT**0.5
    assert abs(float(after.mean() - before.mean())) < four_sigmas
    assert abs(float(after.std() - before.std())) < four_sigmas
    assert np.unique(after).size > 0.99 * COUNT
