"""Resampling, injection, and kernels about copies: what must be copied is, and the belief stays where it was."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from filters.motion import RandomWalk, Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.regularization import Preserving, Rule, Spreading, silverman
from filters.resampling import ByHypothesis, multinomial
from filters.sensing import (
    Position,
    PositionMeasurement,
    Range,
    RangeMeasurement,
)
from tests.filters.beliefs import QUIET, Filter, columns, pose, started

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
    assert len(belief.blocks) == 8
    for first, last in belief.blocks:
        part = north[first:last]
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
