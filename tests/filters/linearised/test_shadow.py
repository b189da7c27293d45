"""The shadow filter beside the particle filter: the same controls, sensors and measurements; and its gate."""

from __future__ import annotations

import math

import numpy as np
import pytest

from filters.belief import Displacement, Moments
from filters.density.gaussian import mahalanobis_square
from filters.extended_kalman import numerical_jacobian
from filters.linearised.shadow import ShadowFilter
from filters.motion import RandomWalk, Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.sensing import (
    Heading,
    HeadingMeasurement,
    Position,
    PositionMeasurement,
    Range,
    RangeMeasurement,
    Velocity,
    VelocityMeasurement,
)

BEACONS = ((-22.0, -12.0), (24.0, -16.0), (4.0, 26.0))
SLOW = (RandomWalk("range_scale", 1e-4),)
MOTION = Unicycle(0.05, 0.02, 1e-4, 1e-4, gyro_bias_sigma=0.01, odometry_scale_sigma=0.05)
NAMES = (*MOTION.names, "range_scale")
START = np.array([-10.0, -4.0, 0.6, 0.0, 1.0, 1.0])
SIGMA = np.array([1.0, 1.0, 0.1, 0.01, 0.05, 0.02])


def moments(mean: np.ndarray = START, sigma: np.ndarray = SIGMA) -> Moments:
    variance = np.square(sigma)
    return Moments(NAMES, mean.copy(), np.diag(variance[:3]), variance, 1.0)


def started(gate: float = 0.999) -> ShadowFilter:
    shadow = ShadowFilter(MOTION, SLOW, gate)
    shadow.initialize(moments())
    return shadow


def drive(
    seed: int, beside: ParticleFilter[UnicycleControl] | None = None
) -> tuple[ShadowFilter, np.ndarray]:
    """Fifteen seconds by all four sensors, from a wrong start, with errors of gyro, odometer and range."""
    rng = np.random.default_rng(seed)
    truth = START + SIGMA * rng.standard_normal(6)
    shadow = started()
    ranging, position = Range(0.3, outliers=0.0, scale="range_scale"), Position(1.0, outliers=0.0)
    velocity, compass = Velocity(0.1, outliers=0.0, scale="odometry_scale"), Heading(0.05, outliers=0.0)
    for tick in range(150):
        rolled = 0.1 + 0.05 * math.sqrt(0.1) * rng.standard_normal()
        turned = 0.012 + 0.02 * math.sqrt(0.1) * rng.standard_normal()
        control = UnicycleControl(0.1 / truth[4], 0.012 + 0.1 * truth[3])
        truth[0] += rolled * math.cos(truth[2] + 0.5 * turned)
        truth[1] += rolled * math.sin(truth[2] + 0.5 * turned)
        truth[2] += turned
        place = BEACONS[tick % 3]
        away = truth[5] * math.hypot(truth[0] - place[0], truth[1] - place[1])
        readings: list[tuple[object, tuple[float | None, ...]]] = [
            (ranging, RangeMeasurement(away + 0.3 * rng.standard_normal(), *place))
        ]
        if tick % 10 == 0:
            north, east = truth[:2] + rng.standard_normal(2)
            readings.append((position, PositionMeasurement(north, east)))
            course = np.array([math.cos(truth[2]), math.sin(truth[2])]) + 0.1 * rng.standard_normal(2)
            # the speed that odometry says, times its scale, is 1 m/s
            readings.append((velocity, VelocityMeasurement(course[0], course[1], 1.0 / truth[4])))
            readings.append((compass, HeadingMeasurement(truth[2] + 0.05 * rng.standard_normal())))
        for belief in (shadow, beside):
            if belief is None:
                continue
            belief.predict(control, 0.1)
            for sensor, reading in readings:
                belief.weigh(sensor, reading)  # type: ignore[arg-type]
        if beside is not None and beside.effective_sample_size < 0.5 * beside.count:
            beside.resample()
    truth[2] = math.remainder(truth[2], 2 * math.pi)
    return shadow, truth


def test_its_claims_hold() -> None:
    """Squared Mahalanobis distance of all six states over 8 drives: chi-square of 48, within five sigma of it.

    False alarm below 1e-6.
    """
    total = 0.0
    for seed in range(8):
        shadow, truth = drive(seed)
        error = shadow.mean - truth
        error[2] = math.remainder(error[2], 2 * math.pi)
        total += mahalanobis_square(error, shadow.covariance)
        assert shadow.rejections <= 8  # of 195 at 0.1 % each: false alarm 1e-11
    assert abs(total - 48.0) < 5.0 * math.sqrt(2.0 * 48.0)


def test_it_agrees_with_the_particle_filter_where_the_belief_is_one_gaussian() -> None:
    """Pose within 0.6 sigma of 20,000 particles' mean, and sigmas to 20 %."""
    count = 20_000
    belief = ParticleFilter(MOTION, capacity=count, seed=5, slow=SLOW)
    rng = np.random.default_rng(6)
    given_path = np.array([0.0, 0.0, 0.0, 0.01, 0.05, 0.0])  # what the motion itself leaves open at the start
    spread = np.sqrt(np.square(SIGMA) - np.square(given_path))
    belief.initialize({n: START[k] + spread[k] * rng.standard_normal(count) for k, n in enumerate(NAMES)})
    shadow, _ = drive(3, belief)
    ours, theirs = shadow.moments(), belief.moments()
    assert ours.names == theirs.names
    sigma = np.sqrt(np.diagonal(theirs.pose_covariance))
    assert (np.abs(ours.mean[:3] - theirs.mean[:3]) < 0.6 * sigma).all()
    np.testing.assert_allclose(np.sqrt(ours.variance[:3]), sigma, rtol=0.2)


def test_a_displacement_moves_the_moments_to_first_order() -> None:
    shadow = started()
    shift = Displacement(2.0, -0.5, 0.3)

    def displaced(pose: np.ndarray) -> np.ndarray:
        sine, cosine = math.sin(pose[2]), math.cos(pose[2])
        return pose + np.array([2.0 * cosine + 0.5 * sine, 2.0 * sine - 0.5 * cosine, 0.3])

    moved = shadow.moments(shift)
    jacobian = numerical_jacobian(displaced, START[:3])
    np.testing.assert_allclose(moved.mean[:3], displaced(START[:3]), atol=1e-12)
    np.testing.assert_allclose(
        moved.pose_covariance, jacobian @ np.diag(np.square(SIGMA[:3])) @ jacobian.T, atol=1e-8
    )
    np.testing.assert_allclose(moved.variance[:3], np.diagonal(moved.pose_covariance))
    np.testing.assert_allclose(moved.variance[3:], np.square(SIGMA[3:]))
    assert moved.effective_sample_size == math.inf
    assert shadow.mean.tolist() == START.tolist()


def test_the_gate_keeps_a_spoofed_fix_out_and_counts_it() -> None:
    shadow = started()
    evidence = shadow.weigh(Position(1.0), PositionMeasurement(50.0, 50.0))
    assert not evidence.accepted
    assert evidence.innovation == pytest.approx(math.hypot(60.0, 54.0))
    assert evidence.log_mean < -100.0
    assert shadow.rejections == 1
    assert shadow.mean.tolist() == START.tolist()
    shadow.initialize(moments())
    assert shadow.rejections == 0


def test_half_a_fix_is_used() -> None:
    shadow = started()
    assert shadow.weigh(Position(1.0), PositionMeasurement(math.nan, -3.0)).accepted
    assert shadow.mean[0] == START[0]
    assert shadow.mean[1] == pytest.approx(-3.5)


def test_what_the_sensor_refuses_and_what_has_no_counterpart() -> None:
    shadow = started()
    assert not shadow.weigh(Range(0.3), RangeMeasurement(-1.0, 0.0, 0.0)).accepted
    assert shadow.rejections == 0

    class Altimeter(Heading):
        pass

    with pytest.raises(TypeError, match="Altimeter"):
        shadow.weigh(Altimeter(0.1), HeadingMeasurement(0.0))


def test_a_start_of_other_dimensions_is_refused() -> None:
    shadow = started()
    with pytest.raises(ValueError, match="range_scale"):
        shadow.initialize(moments()._replace(names=MOTION.names))
    assert shadow.mean.tolist() == START.tolist()
    for gate in (0.0, 1.0, math.nan):
        with pytest.raises(ValueError, match="gate"):
            ShadowFilter(MOTION, SLOW, gate)
