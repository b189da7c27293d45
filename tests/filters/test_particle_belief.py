"""What a weighted set says: moments against numpy, weights that go wrong, the cloud."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from filters.belief import Displacement
from filters.motion import RandomWalk, Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.sensing import (
    Heading,
    HeadingMeasurement,
    Position,
    PositionMeasurement,
    Range,
    RangeMeasurement,
)
from tests.filters.beliefs import QUIET, columns, pose, started

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
    assert {column.tobytes() for column in pose(belief).T} <= {column.tobytes() for column in before.T}


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
