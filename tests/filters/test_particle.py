"""The particle filter against exact beliefs, a plain rewriting, and the ways in which such filters break."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import special

from filters.belief import Displacement
from filters.kalman import KalmanFilter
from filters.kernels import random
from filters.motion import Unicycle, UnicycleControl
from filters.sensing import (
    Heading,
    HeadingMeasurement,
    Position,
    PositionMeasurement,
    Range,
    RangeMeasurement,
)
from tests.filters.beliefs import pose, started

# ---- against exact beliefs


def test_it_is_the_kalman_filter_where_all_is_linear() -> None:
    """North alone moves, heading pinned: mean and variance within 5 standard deviations of 200,000 particles.

    The number of effective particles at each comparison sets the tolerance; twelve comparisons of two
    figures: false alarm below 2e-5.
    """
    speed_noise, duration, sigma, count = 0.8, 0.2, 0.7, 200_000
    belief = started(count, motion=Unicycle(speed_noise, 0.0, 0.0, 0.0), spread=2.0, heading_spread=0.0)
    exact = KalmanFilter([0.0], [[4.0]])
    rng = np.random.default_rng(4)
    sensor = Position(sigma, outliers=0.0)
    for _ in range(12):
        distance, z = 0.5, float(rng.normal(0.5, 1.0))
        belief.predict(UnicycleControl(distance, 0.0), duration)
        exact.predict([[1.0]], [[speed_noise**2 * duration]], [[1.0]], [distance])
        belief.weigh(sensor, PositionMeasurement(z, 0.0))
        exact.correct([z], [[1.0]], [[sigma**2]])
        moments = belief.moments()
        variance = exact.covariance[0, 0]
        effective = min(moments.effective_sample_size, 40_000.0)
        assert abs(moments.mean[0] - exact.mean[0]) < 5 * math.sqrt(variance / effective)
        assert abs(moments.variance[0] / variance - 1.0) < 5 * math.sqrt(2.0 / effective)
        if belief.effective_sample_size < count / 2:
            belief.resample()


def test_evidence_is_the_density_of_the_innovation() -> None:
    """Within 5 standard deviations of the 2,048 particles that it is taken over."""
    belief = started(100_000, spread=1.0)
    evidence = belief.weigh(Position(0.5, outliers=0.0), PositionMeasurement(0.4, -0.3))
    exact = -math.log(2 * math.pi * 1.25) - 0.5 * (0.4**2 + 0.3**2) / 1.25
    assert evidence.log_mean == pytest.approx(exact, abs=5 * math.sqrt(1.0 / 2048))
    assert evidence.innovation == pytest.approx(0.5, abs=0.05)
    assert evidence.accepted


@pytest.mark.interpreted
def test_evidence_of_a_small_set_is_exact_and_obeys_the_chain_rule() -> None:
    belief = started(500, block=64)
    sensor = Range(0.8, outliers=0.1, span=50.0)
    north, east, _ = pose(belief)
    log_weights = np.zeros(500)
    for distance, n, e in ((4.0, 3.0, 3.0), (9.0, -5.0, 6.0), (30.0, 0.0, 1.0)):
        evidence = belief.weigh(sensor, RangeMeasurement(distance, n, e))
        q = (distance - np.hypot(north - n, east - e)) / 0.8
        likelihood = 0.9 * np.exp(-0.5 * q * q) / (0.8 * math.sqrt(2 * math.pi)) + 0.1 / 50.0
        exact = special.logsumexp(log_weights + np.log(likelihood)) - special.logsumexp(log_weights)
        assert evidence.log_mean == pytest.approx(exact, abs=1e-4)
        log_weights += np.log(likelihood)
        if n < 0:
            belief.normalize()


# ---- against a plain rewriting


@pytest.mark.interpreted
@pytest.mark.parametrize("block", [64, 1000, 32768])
def test_a_whole_step_is_that_of_a_plain_rewriting(block: int) -> None:
    count, duration = 3000, 0.1
    motion = Unicycle(0.5, 0.3, 0.0, 0.0)
    belief = started(count, motion=motion, block=block, seed=77)
    north, east, heading = pose(belief)
    noise = np.zeros((2, count), np.float32)
    random.normal_pairs(0, count, 1, random.key(77, 0), noise, 0)
    belief.predict(UnicycleControl(1.0, 0.2), duration)
    d = 1.0 + 0.5 * math.sqrt(duration) * noise[0].astype(np.float64)
    t = 0.2 + 0.3 * math.sqrt(duration) * noise[1].astype(np.float64)
    north = north + d * np.cos(heading + t / 2)
    east = east + d * np.sin(heading + t / 2)
    heading = heading + t
    np.testing.assert_allclose(pose(belief), [north, east, heading], atol=2e-5)

    belief.weigh(Range(0.3, outliers=0.0), RangeMeasurement(5.0, 4.0, 4.0))
    belief.weigh(Heading(0.2, outliers=0.0), HeadingMeasurement(0.1))
    log_weights = (
        -0.5 * ((5.0 - np.hypot(north - 4.0, east - 4.0)) / 0.3) ** 2 - 0.5 * ((0.1 - heading) / 0.2) ** 2
    )
    weights = np.exp(log_weights - log_weights.max())
    np.testing.assert_allclose(belief.weights, weights, rtol=2e-3, atol=1e-7)
    weights /= weights.sum()
    assert belief.effective_sample_size == pytest.approx(1.0 / np.sum(weights**2), rel=1e-4)

    moments = belief.moments()
    state = np.stack([north, east, heading])
    mean = state @ weights
    mean[2] = math.atan2(np.sin(heading) @ weights, np.cos(heading) @ weights)
    offsets = state - mean[:, None]
    np.testing.assert_allclose(moments.mean[:3], mean, atol=2e-5)
    np.testing.assert_allclose(moments.pose_covariance, (offsets * weights) @ offsets.T, atol=2e-5)
    np.testing.assert_allclose(moments.variance[:3], np.diag(moments.pose_covariance))


# ---- the same bytes


def history(seed: int, block: int = 500) -> bytes:
    belief = started(2000, capacity=3000, motion=Unicycle(0.5, 0.2, 1e-3, 1e-3), seed=seed, block=block)
    said: list[bytes] = []
    for k in range(25):
        belief.predict(UnicycleControl(0.1, 0.05), 0.02)
        evidence = belief.weigh(Range(0.4), RangeMeasurement(5.0, 3.0, 4.0))
        moments = belief.moments(Displacement(0.1, 0.0, 0.02))
        said += [np.array(evidence).tobytes(), moments.mean.tobytes(), moments.pose_covariance.tobytes()]
        belief.resample(1000 + 60 * k)
        said.append(belief.cloud(50).tobytes())
    return b"".join(said)


def test_one_seed_gives_the_same_bytes() -> None:
    assert history(1) == history(1)
    assert history(1) != history(2)


# ---- several measurements at once

BEACONS = ((3.0, 4.0), (-3.0, 4.0), (0.5, -6.0), (8.0, 1.0))


def ranges(*sigmas: float | None) -> list[RangeMeasurement]:
    return [RangeMeasurement(5.0 + 0.3 * k, *BEACONS[k], 0.2 * k, sigma) for k, sigma in enumerate(sigmas)]


@pytest.mark.parametrize("count", [1, 999, 5000])
@pytest.mark.parametrize(
    "sensor",
    [Range(0.4, outliers=0.0), Range(0.4), Range(0.4, scale="odometry_scale", bias="gyro_bias")],
    ids=["plain", "robust", "with slow states"],
)
def test_all_at_once_is_one_after_the_other(sensor: Range, count: int) -> None:
    """The same weights to the bit, the same evidence; the centre is where the motion has taken it."""
    measured = ranges(None, 0.7, None, 0.2)
    beliefs = [started(count, motion=Unicycle(0.5, 0.2, 1e-3, 1e-3)) for _ in range(2)]
    for _ in range(3):
        for belief in beliefs:
            belief.predict(UnicycleControl(0.3, 0.1), 0.5)
        together = beliefs[0].weigh_all(sensor, measured)
        apart = [beliefs[1].weigh(sensor, measurement) for measurement in measured]
        assert beliefs[0].weights.tobytes() == beliefs[1].weights.tobytes()
        np.testing.assert_allclose(np.array(together), np.array(apart), rtol=1e-6, atol=1e-12)
        assert beliefs[0].moments().mean.tobytes() == beliefs[1].moments().mean.tobytes()


def test_a_refused_one_among_several_is_the_only_one_refused() -> None:
    belief, other = started(500), started(500)
    measured = ranges(None, -1.0, None)
    said = belief.weigh_all(Range(0.4), measured)
    assert [evidence.accepted for evidence in said] == [True, False, True]
    for measurement in measured:
        other.weigh(Range(0.4), measurement)
    assert belief.weights.tobytes() == other.weights.tobytes()


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_one_that_is_not_finite_among_several_touches_nothing(value: float) -> None:
    belief = started(500)
    with pytest.raises(ValueError, match="finite"):
        belief.weigh_all(Range(0.4), [*ranges(None, None), RangeMeasurement(5.0, value, 0.0)])
    assert np.all(belief.weights == 1.0)


def test_any_sensor_and_any_number_can_be_weighed_by_at_once() -> None:
    belief, other = started(500), started(500)
    headings = [HeadingMeasurement(0.1 * k) for k in range(3)]
    many = ranges(None) * 40
    assert belief.weigh_all(Range(0.4), []) == []
    together = belief.weigh_all(Heading(0.5), headings) + belief.weigh_all(Range(9.0), many)
    apart = [other.weigh(Heading(0.5), one) for one in headings] + [
        other.weigh(Range(9.0), one) for one in many
    ]
    assert together == apart
