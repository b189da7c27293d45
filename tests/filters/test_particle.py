"""The particle filter against exact beliefs, a plain rewriting, and the ways in which such filters break."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import special

from filters.belief import Displacement
from filters.kalman import KalmanFilter
from filters.kernels import random
from filters.motion import RandomWalk, Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.regularization import Preserving, Rule, Spreading, silverman
from filters.resampling import ByHypothesis, multinomial
from filters.sensing import (
    Heading,
    HeadingMeasurement,
    Position,
    PositionMeasurement,
    Range,
    RangeMeasurement,
)

QUIET = Unicycle(0.0, 0.0, 0.0, 0.0)
Filter = ParticleFilter[UnicycleControl]


def columns(
    count: int, seed: int = 1, spread: float = 1.0, heading: float = 0.0, heading_spread: float = 0.1
) -> dict[str, NDArray[np.float64]]:
    rng = np.random.default_rng(seed)
    return {
        "north": rng.normal(0, spread, count),
        "east": rng.normal(0, spread, count),
        "heading": rng.normal(heading, heading_spread, count),
        "gyro_bias": np.zeros(count),
        "odometry_scale": np.ones(count),
    }


def started(
    count: int,
    *,
    motion: Unicycle = QUIET,
    capacity: int = 0,
    block: int = 32768,
    seed: int = 3,
    **spread: float,
) -> Filter:
    belief = ParticleFilter(motion, capacity=max(capacity, count), seed=seed, block=block)
    belief.initialize(columns(count, **spread))
    return belief


def pose(belief: Filter) -> NDArray[np.float64]:
    return np.stack([belief.column(name) for name in ("north", "east", "heading")]).astype(np.float64)


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


# ---- moments


def circular(heading: NDArray[np.float64]) -> tuple[float, float]:
    mean = math.atan2(np.sin(heading).mean(), np.cos(heading).mean())
    return mean, float(np.mean(((heading - mean + math.pi) % (2 * math.pi) - math.pi) ** 2))


@pytest.mark.parametrize("heading", [0.0, 3.0, math.pi, -math.pi, -3.1, 20.0])
@pytest.mark.parametrize("spread", [0.05, 0.8, 3.0])
def test_the_heading_is_circular(heading: float, spread: float) -> None:
    belief = started(5000, heading=heading, heading_spread=spread)
    mean, variance = circular(columns(5000, heading=heading, heading_spread=spread)["heading"])
    moments = belief.moments()
    assert -math.pi <= moments.mean[2] <= math.pi
    assert math.remainder(moments.mean[2] - mean, 2 * math.pi) == pytest.approx(0.0, abs=2e-4)
    assert moments.variance[2] == pytest.approx(variance, rel=2e-3)


def test_a_turned_belief_is_measured_about_where_it_is_now() -> None:
    """After half a turn no reference of before must show."""
    belief = started(4000, motion=Unicycle(0.0, 0.5, 0.0, 0.0), heading=1.0, heading_spread=0.5)
    belief.predict(UnicycleControl(0.0, 2.5), 1.0)
    belief.weigh(Heading(0.4), HeadingMeasurement(-2.0))
    w = belief.weights.astype(np.float64)
    h = pose(belief)[2]
    mean = math.atan2(np.sin(h) @ w, np.cos(h) @ w)
    variance = w @ ((h - mean + math.pi) % (2 * math.pi) - math.pi) ** 2 / w.sum()
    moments = belief.moments()
    assert moments.mean[2] == pytest.approx(mean, abs=1e-4)
    assert moments.variance[2] == pytest.approx(variance, rel=1e-3)


@pytest.mark.parametrize("heading_spread", [0.1, 1.0, 4.0])
def test_displaced_moments_are_those_of_displaced_particles(heading_spread: float) -> None:
    belief = started(4000, heading=2.0, heading_spread=heading_spread)
    belief.weigh(Position(1.0), PositionMeasurement(0.5, 0.5))
    w = belief.weights.astype(np.float64)
    w /= w.sum()
    before = pose(belief)
    n, e, h = before
    shift = Displacement(3.0, -0.5, 2.5)
    n, e, h = n + 3.0 * np.cos(h) + 0.5 * np.sin(h), e + 3.0 * np.sin(h) - 0.5 * np.cos(h), h + 2.5
    mean = np.array([n @ w, e @ w, math.atan2(np.sin(h) @ w, np.cos(h) @ w)])
    offsets = np.stack([n - mean[0], e - mean[1], (h - mean[2] + math.pi) % (2 * math.pi) - math.pi])
    for _ in range(2):  # the second time from another centre
        moments = belief.moments(shift)
        np.testing.assert_allclose(moments.mean[:3], mean, atol=2e-4)
        np.testing.assert_allclose(moments.pose_covariance, (offsets * w) @ offsets.T, atol=1e-3)
    assert np.array_equal(pose(belief), before)


def test_slow_states_have_moments() -> None:
    belief = ParticleFilter(QUIET, capacity=1000, seed=1, slow=[RandomWalk("range_bias", 0.0)])
    rng = np.random.default_rng(1)
    given = {
        **columns(1000),
        "range_bias": rng.normal(0.5, 0.2, 1000),
        "gyro_bias": rng.normal(0, 1e-3, 1000),
    }
    belief.initialize(given)
    moments = belief.moments()
    assert moments.names == (*QUIET.names, "range_bias")
    np.testing.assert_allclose(
        moments.mean[3:], [given[name].mean() for name in moments.names[3:]], atol=1e-6
    )
    np.testing.assert_allclose(
        moments.variance[[3, 5]], [given["gyro_bias"].var(), given["range_bias"].var()], rtol=1e-4
    )


def test_moments_far_from_the_origin_keep_their_digits() -> None:
    belief = started(2000, spread=0.05)
    belief.column("north")[:] += np.float32(20_000.0)
    north = pose(belief)[0]
    belief.moments()
    moments = belief.moments()
    assert moments.mean[0] == pytest.approx(north.mean(), abs=2e-3)
    assert moments.variance[0] == pytest.approx(north.var(), rel=1e-3)


# ---- weights that go wrong


@pytest.mark.interpreted
def test_all_weights_zero_keeps_the_set() -> None:
    belief = started(1000)
    before = pose(belief)
    belief.weigh(Range(0.1, outliers=0.0), RangeMeasurement(1.0, 1e25, 0.0))
    for _ in range(2):
        evidence = belief.weigh(Position(1e-30, outliers=0.0), PositionMeasurement(1e30, 0.0))
        assert evidence.log_mean == -math.inf
    belief.normalize()
    assert belief.collapses == 1
    assert belief.effective_sample_size == pytest.approx(1000.0)
    belief.resample(500)
    assert set(map(tuple, pose(belief).T)) <= set(map(tuple, before.T))


def test_a_far_measurement_is_evidence_of_a_wrong_belief_not_of_none() -> None:
    """A pure Gaussian at hundreds of sigma, where exp underflows: the nearest particle survives."""
    belief = started(1000)
    north = pose(belief)[0]
    evidence = belief.weigh(Range(0.01, outliers=0.0), RangeMeasurement(5.0, 100.0, 0.0))
    assert -1e9 < evidence.log_mean < -1e6
    belief.normalize()
    assert belief.collapses == 0
    assert pose(belief)[0][np.argmax(belief.weights)] == north.max()


@pytest.mark.interpreted
def test_one_particle() -> None:
    belief = started(1)
    for _ in range(3):
        belief.predict(UnicycleControl(0.1, 0.1), 0.1)
        belief.weigh(Range(0.1), RangeMeasurement(3.0, 1.0, 1.0))
        belief.normalize()
        moments = belief.moments()
        assert belief.effective_sample_size == pytest.approx(1.0)
        assert np.abs(moments.pose_covariance).max() < 1e-9
        belief.resample()
    belief.resample(1)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_never_touches_the_weights(value: float) -> None:
    belief = started(100)
    belief.weigh(Range(0.5), RangeMeasurement(3.0, 1.0, 1.0))
    before = belief.weights.copy()
    for measurement in (
        RangeMeasurement(value, 0.0, 0.0),
        RangeMeasurement(1.0, 0.0, value),
        RangeMeasurement(1.0, 0.0, 0.0, 0.0, value),
    ):
        with pytest.raises(ValueError, match="finite"):
            belief.weigh(Range(0.5), measurement)
    assert np.array_equal(belief.weights, before)
    for duration in (value, -0.1):
        with pytest.raises(ValueError, match="duration"):
            belief.predict(UnicycleControl(0.0, 0.0), duration)
    with pytest.raises(ValueError, match="finite"):
        belief.predict(UnicycleControl(value, 0.0), 0.1)


def test_a_refused_measurement_is_not_accepted() -> None:
    belief = started(100)
    evidence = belief.weigh(Range(0.5, longest=10.0), RangeMeasurement(11.0, 1.0, 1.0))
    assert not evidence.accepted
    assert math.isnan(evidence.log_mean)
    assert (belief.weights == 1.0).all()


# ---- resampling


@pytest.mark.interpreted
@given(st.integers(1, 400), st.integers(1, 400), st.integers(1, 90), st.integers(0, 2**64 - 1))
@settings(max_examples=60, deadline=None)
def test_resampling_copies_whole_particles(source: int, target: int, block: int, seed: int) -> None:
    belief = started(source, capacity=400, block=block, seed=seed)
    belief.weigh(Position(0.5), PositionMeasurement(1.0, 0.0))
    weights = belief.weights.astype(np.float64)
    states = {tuple(state): i for i, state in enumerate(pose(belief).T)}
    belief.resample(target)
    assert belief.count == target
    copies = np.bincount([states[tuple(state)] for state in pose(belief).T], minlength=source)
    assert (np.abs(copies - target * weights / weights.sum()) < 1.0 + 1e-6).all()
    assert (belief.weights == 1.0).all()
    assert belief.effective_sample_size == pytest.approx(target)


def test_resampling_does_not_move_the_belief() -> None:
    """Systematic resampling errs far less than independent draws: within 1 of their standard deviations."""
    belief = started(50_000, block=4096)
    belief.weigh(Position(0.7), PositionMeasurement(0.5, -0.5))
    before = belief.moments()
    belief.resample(30_000)
    after = belief.moments()
    assert (np.abs(after.mean[:2] - before.mean[:2]) < np.sqrt(before.variance[:2] / 30_000)).all()


def test_every_block_is_a_fair_sample() -> None:
    """Sorted particles, resampled: the mean of each block within 1 sigma of independent draws."""
    count, block = 20_000, 3000
    belief = ParticleFilter(QUIET, capacity=count, seed=1, block=block)
    given = columns(count)
    given["north"] = np.sort(given["north"])
    belief.initialize(given)
    belief.weigh(Position(2.0), PositionMeasurement(1.0, 0.0))
    belief.resample(19_001)
    moments = belief.moments()
    north = belief.column("north").astype(np.float64)
    size = math.ceil(19_001 / 7)
    for first in range(0, 19_001, size):
        part = north[first : first + size]
        assert abs(part.mean() - moments.mean[0]) < math.sqrt(moments.variance[0] / part.size)
        assert part.var() == pytest.approx(moments.variance[0], rel=0.05)


def test_the_count_may_change_every_step() -> None:
    belief = started(1000, capacity=5000, motion=Unicycle(0.1, 0.1, 1e-3, 1e-3), block=300)
    for count in (1, 5000, 17, 301, 300, 4999, 2, 1000):
        belief.predict(UnicycleControl(0.1, 0.0), 0.1)
        belief.weigh(Range(0.5), RangeMeasurement(3.0, 2.0, 2.0))
        belief.resample(count)
        assert belief.count == count == belief.column("north").size
        assert np.isfinite(belief.moments().pose_covariance).all()


@pytest.mark.parametrize("count", [0, -1, 1001])
def test_a_count_out_of_bounds_is_refused(count: int) -> None:
    belief = started(10, capacity=1000)
    with pytest.raises(ValueError, match="1 to 1000"):
        belief.resample(count)
    assert belief.count == 10


# ---- after a jump


def test_a_belief_that_jumps_is_measured_about_where_it_went() -> None:
    """One measurement leaves 100 of 20,000 particles, 5 km from the centre, with a spread of 5 cm.

    About the old centre a sum of squares in single precision cannot tell 25,000,000 m² from 25,000,000.0025.
    """
    rng = np.random.default_rng(5)
    start = columns(20_000, spread=30.0)
    start["north"][:100] = rng.normal(4000.0, 0.05, 100)
    start["east"][:100] = rng.normal(-3000.0, 0.05, 100)
    belief = ParticleFilter(QUIET, capacity=20_000, seed=1)
    belief.initialize(start)
    belief.weigh(Position(1.0, outliers=0.0), PositionMeasurement(4000.0, -3000.0))
    north, east, _ = pose(belief)
    w = belief.weights.astype(np.float64) / belief.weights.sum()
    exact = np.cov(np.stack([north, east]), aweights=w, ddof=0)
    moments = belief.moments()
    np.testing.assert_allclose(moments.mean[:2], [north @ w, east @ w], atol=1e-3)
    np.testing.assert_allclose(moments.pose_covariance[:2, :2], exact, atol=0.02 * exact[0, 0])


@given(st.integers(0, 10_000))
@settings(max_examples=40, deadline=None)
def test_the_covariance_of_two_particles_is_one(seed: int) -> None:
    """Two places lie on a line; rounding must not make their correlation larger than one."""
    rng = np.random.default_rng(seed)
    start = columns(2, seed=seed) | {name: rng.uniform(-50, 50, 2) for name in ("north", "east")}
    belief = ParticleFilter(QUIET, capacity=2, seed=1)
    belief.initialize(start)
    belief.weigh(Position(30.0), PositionMeasurement(7.25, 4.0))
    nn, ne, ee = belief.moments().pose_covariance[[0, 0, 1], [0, 1, 1]]
    assert ne * ne <= nn * ee * (1.0 + 1e-12)


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


# ---- the cloud, and what is refused at the start


def test_the_cloud_is_a_fair_sample() -> None:
    belief = started(10_000, heading=1.0)
    belief.weigh(Position(1.0), PositionMeasurement(1.0, 1.0))
    cloud = belief.cloud(2000, Displacement(1.0, 0.0, 0.5))
    moments = belief.moments(Displacement(1.0, 0.0, 0.5))
    assert cloud.shape == (2000, 4)
    assert cloud[:, 3].sum() == pytest.approx(1.0, abs=0.1)
    mean = np.average(cloud[:, :3], axis=0, weights=cloud[:, 3])
    assert (np.abs(mean - moments.mean[:3]) < 5 * np.sqrt(moments.variance[:3] / 1000)).all()


def test_the_cloud_writes_where_it_is_told() -> None:
    belief = started(10)
    out = np.zeros((20, 4), np.float32)
    cloud = belief.cloud(20, out=out)
    assert cloud.shape == (10, 4)
    assert np.shares_memory(cloud, out)
    assert np.array_equal(cloud[:, 0], belief.column("north"))
    with pytest.raises(ValueError, match="rows"):
        belief.cloud(10, out=np.zeros((9, 4), np.float32))
    assert belief.cloud(0).shape == (0, 4)


def test_a_wrong_start_is_refused() -> None:
    belief = ParticleFilter(QUIET, capacity=100, seed=1)
    good = columns(50)
    for bad, what in (
        ({name: good[name] for name in list(good)[:-1]}, "missing"),
        ({**good, "depth": np.zeros(50)}, "unknown"),
        ({**good, "east": np.zeros(49)}, "one length"),
        ({**good, "east": np.zeros((50, 1))}, "one-dimensional"),
        (columns(101), "100"),
        (columns(0), "got 0"),
        ({**good, "heading": np.full(50, np.nan)}, "heading"),
    ):
        with pytest.raises(ValueError, match=what):
            belief.initialize(bad)
    assert belief.count == 0
    with pytest.raises(KeyError, match="depth"):
        belief.column("depth")


def test_a_wrong_shape_is_refused() -> None:
    with pytest.raises(ValueError, match="capacity"):
        ParticleFilter(QUIET, capacity=0, seed=1)
    with pytest.raises(ValueError, match="twice"):
        ParticleFilter(QUIET, capacity=1, seed=1, slow=[RandomWalk("north", 0.0)])


# ---- given particles in the place of some


def given_poses(count: int) -> dict[str, NDArray[np.float64]]:
    rng = np.random.default_rng(8)
    return {"north": rng.normal(50.0, 2.0, count), "east": rng.normal(-20.0, 1.0, count)}


def test_injection_makes_a_mixture() -> None:
    """30 % new ones: the mean of the mixture, within 5 standard deviations of 20,000 particles."""
    belief = started(20_000)
    belief.weigh(Position(1.0, outliers=0.0), PositionMeasurement(2.0, 0.0))
    before = belief.moments()
    poses = given_poses(6000)
    belief.inject(poses)
    assert belief.count == 20_000
    assert belief.weights.tolist() == [1.0] * 20_000
    north, east, heading = pose(belief)
    assert np.isin(poses["north"].astype(np.float32), north).all()
    mean = 0.7 * before.mean[:2] + 0.3 * np.array([50.0, -20.0])
    assert np.abs([north.mean(), east.mean()] - mean).max() < 5 * 2.0 / math.sqrt(6000)
    kept = north < 25.0
    assert kept.sum() == 14_000
    assert abs(north[kept].mean() - before.mean[0]) < 5 * math.sqrt(before.variance[0] / 10_000)
    assert abs(heading.mean() - before.mean[2]) < 5 * math.sqrt(before.variance[2] / 10_000)


def test_injection_keeps_what_is_not_given() -> None:
    belief = ParticleFilter(QUIET, capacity=1000, seed=1, slow=[RandomWalk("range_bias", 0.0)], block=128)
    belief.initialize({**columns(500), "range_bias": np.full(500, 0.3)})
    belief.inject({**given_poses(200), "heading": np.full(200, 7.0)}, 1000)
    assert belief.count == 1000
    assert (belief.column("range_bias") == np.float32(0.3)).all()
    assert (np.isclose(belief.column("heading"), 7.0 - 2 * math.pi, atol=1e-6)).sum() == 200
    new = belief.column("north") > 25.0
    per_block = [new[first : first + 125].sum() for first in range(0, 1000, 125)]
    assert per_block == [25] * 8  # a block stands for the whole


def test_every_ancestor_is_as_likely_to_give_way() -> None:
    """Equal weights, 3 of 10 replaced, 2,000 times: survivals by chi-square (false alarm below 1e-6)."""
    belief, survived = ParticleFilter(QUIET, capacity=10, seed=1), np.zeros(10)
    for _ in range(2000):
        belief.initialize({**columns(10), "north": np.arange(10.0)})
        belief.inject({"north": np.full(3, 99.0)})
        left = belief.column("north")
        survived += np.bincount(left[left < 50].astype(int), minlength=10)
    assert survived.sum() == 14_000
    assert (np.abs(survived - 1400) < 5.5 * math.sqrt(2000 * 0.3 * 0.7)).all()


def test_a_whole_belief_can_be_replaced() -> None:
    belief = started(50)
    belief.inject(given_poses(50))
    assert (belief.column("north") > 25.0).all()


@pytest.mark.parametrize(
    ("given", "count", "what"),
    [
        ({}, None, "none"),
        ({"depth": np.zeros(3)}, None, "depth"),
        ({"north": np.zeros(51)}, None, "1 to 50"),
        ({"north": np.zeros(0)}, None, "got 0"),
        ({"north": np.zeros(3), "east": np.zeros(4)}, None, "one length"),
        ({"north": np.array([0.0, math.nan])}, None, "finite"),
        ({"north": np.zeros(3)}, 101, "1 to 100"),
    ],
)
def test_a_wrong_injection_changes_nothing(
    given: dict[str, NDArray[np.float64]], count: int | None, what: str
) -> None:
    belief = started(50, capacity=100)
    before = belief.columns.copy()
    with pytest.raises(ValueError, match=what):
        belief.inject(given, count)
    assert np.array_equal(belief.columns, before)
    assert belief.count == 50


# ---- other schemes, and kernels for slow states


def test_any_scheme_resamples() -> None:
    """By hypothesis, both of two places keep their share exactly where the draws of one number might not."""
    belief = started(1000)
    belief.weigh(Position(2.0), PositionMeasurement(0.5, 0.5))
    labels = (belief.column("north") > 0.5).astype(int)
    share = belief.weights[labels == 1].sum() / belief.weights.sum()
    belief.resample(400, ByHypothesis(labels))
    assert abs((belief.column("north") > 0.5).sum() - 400 * share) < 1.0
    belief.resample(800, multinomial)
    assert belief.count == 800


SLOW = (RandomWalk("range_bias", 0.0), RandomWalk("range_scale", 0.0), RandomWalk("heading_bias", 0.0))


def with_slow_states(count: int, block: int = 32768) -> Filter:
    rng = np.random.default_rng(6)
    bias, scale, third = rng.multivariate_normal(
        [1.0, 1.02, 0.0], [[0.04, 0.003, 0.0], [0.003, 0.0004, 0.0], [0.0, 0.0, 1.0]], count
    ).T
    belief = ParticleFilter(QUIET, capacity=count, seed=2, slow=SLOW, block=block)
    belief.initialize({**columns(count), "range_bias": bias, "range_scale": scale, "heading_bias": third})
    belief.weigh(Position(1.0, outliers=0.0), PositionMeasurement(1.0, 0.0))
    return belief


def slow_moments(belief: Filter) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    rows = np.stack([belief.column(walk.name) for walk in SLOW]).astype(np.float64)
    weights = belief.weights.astype(np.float64)
    return rows @ weights / weights.sum(), np.cov(rows, aweights=weights, ddof=0)


@pytest.mark.parametrize("rule", [Preserving(), Spreading()])
def test_a_kernel_gives_every_copy_a_value_of_its_own(rule: Rule) -> None:
    """Means and covariances within 5 standard deviations; Preserving keeps them, Spreading adds h² V."""
    belief = with_slow_states(20_000, block=5000)
    mean, covariance = slow_moments(belief)
    effective = belief.effective_sample_size
    bandwidth = silverman(effective, 3)
    names = [walk.name for walk in SLOW]
    belief.resample_regularized(names, rule)
    after_mean, after = slow_moments(belief)
    grown = 1.0 + (bandwidth**2 if isinstance(rule, Spreading) else 0.0)
    sigma = np.sqrt(np.diag(covariance))
    assert (np.abs(after_mean - mean) < 5 * sigma / math.sqrt(effective)).all()
    np.testing.assert_allclose(
        after / np.outer(sigma, sigma),
        grown * covariance / np.outer(sigma, sigma),
        atol=5 * math.sqrt(2 / effective),
    )
    assert np.unique(belief.column("range_bias")).size > 0.99 * 20_000
    assert np.unique(belief.column("north")).size < 0.9 * 20_000  # the pose is copied as ever


def test_kernels_keep_alive_what_mere_copies_freeze() -> None:
    """300 resamplings: the plain set is left with a few values, the kernel's with 500, as wide as ever."""
    plain, kernel = with_slow_states(500), with_slow_states(500)
    _, covariance = slow_moments(plain)
    for _ in range(300):
        plain.resample(None, multinomial)
        kernel.resample_regularized(["range_bias"], Preserving(), None, multinomial)
    assert np.unique(plain.column("range_bias")).size < 20
    assert np.unique(kernel.column("range_bias")).size > 490
    assert 0.3 < kernel.column("range_bias").var() / covariance[0, 0] < 3.0


@pytest.mark.parametrize(
    ("names", "error", "what"),
    [
        ([], ValueError, "none"),
        (["range_bias", "range_bias"], ValueError, "once"),
        (["north"], ValueError, "pose"),
        (["gyro_bias"], ValueError, "marginalised"),
        (["depth"], KeyError, "depth"),
    ],
)
def test_what_a_kernel_cannot_spread_is_refused(names: list[str], error: type[Exception], what: str) -> None:
    belief = with_slow_states(100)
    before = belief.columns.copy()
    with pytest.raises(error, match=what):
        belief.resample_regularized(names, Preserving())
    assert np.array_equal(belief.columns, before)


def test_tempering_leaves_a_share_effective_and_the_order_as_it_was() -> None:
    belief = started(5000, spread=5.0)
    belief.weigh(Position(0.1, outliers=0.0), PositionMeasurement(0.3, -0.2))
    before, worn = belief.weights.copy(), belief.effective_sample_size
    assert worn < 0.01 * 5000
    exponent = belief.temper(0.2)
    assert belief.effective_sample_size == pytest.approx(0.2 * 5000, rel=0.02)
    assert belief.tempered == 1
    inside = before > 1e-30
    np.testing.assert_allclose(belief.weights[inside], before[inside] ** exponent, rtol=1e-3)


def test_nothing_is_tempered_that_is_not_worn() -> None:
    belief = started(1000)
    belief.weigh(Position(5.0, outliers=0.0), PositionMeasurement(0.3, -0.2))
    before = belief.weights.copy()
    assert belief.temper(0.2) == 1.0
    assert belief.tempered == 0
    np.testing.assert_array_equal(belief.weights, before)


def test_evidence_after_tempering_is_that_of_the_tempered_belief() -> None:
    belief = started(1500, spread=5.0)
    belief.weigh(Position(0.1, outliers=0.0), PositionMeasurement(0.3, -0.2))
    belief.temper(0.2)
    share = belief.weights / belief.weights.sum(dtype=np.float64)
    north, east = belief.column("north").copy(), belief.column("east").copy()
    evidence = belief.weigh(Position(2.0, outliers=0.0), PositionMeasurement(1.0, 1.0))
    density = np.exp(-((north - 1.0) ** 2 + (east - 1.0) ** 2) / 8.0) / (8.0 * math.pi)
    assert evidence.log_mean == pytest.approx(math.log(float(share @ density)), abs=1e-4)


@pytest.mark.parametrize("block", [32768, 160])
def test_rejuvenated_copies_differ_and_weights_and_slow_states_stay(block: int) -> None:
    belief = started(2000, block=block, spread=2.0)
    belief.weigh(Position(0.2, outliers=0.0), PositionMeasurement(0.3, -0.2))
    belief.resample()
    before = {name: belief.column(name).copy() for name in belief.names}
    alike = np.unique(before["north"]).size
    belief.rejuvenate(0.4)
    assert alike < 200
    assert np.unique(belief.column("north")).size > 1950
    assert belief.effective_sample_size == 2000.0
    for name in belief.names[3:]:
        np.testing.assert_array_equal(belief.column(name), before[name])
    for name in ("north", "east"):
        assert float(belief.column(name).std()) == pytest.approx(float(before[name].std()), rel=0.3)
    again = started(2000, block=block, spread=2.0)
    again.weigh(Position(0.2, outliers=0.0), PositionMeasurement(0.3, -0.2))
    again.resample()
    again.rejuvenate(0.4)
    np.testing.assert_array_equal(again.columns[:, :2000], belief.columns[:, :2000])
