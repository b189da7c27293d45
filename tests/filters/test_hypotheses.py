"""Hypotheses followed over time, against exact mixtures of Kalman filters and shapes that are one place."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from filters.hypotheses import DROPPED, EVEN_PART, FADES, Hypotheses
from filters.motion import Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.sensing import Position, PositionMeasurement, Range, RangeMeasurement

Columns = NDArray[np.float32]


def place(
    rng: np.random.Generator, count: int, north: float, east: float, heading: float = 0.0, sigma: float = 0.3
) -> Columns:
    """Particles about one place."""
    middle = np.array([[north], [east], [heading]])
    return (middle + rng.normal(size=(3, count)) * [[sigma], [sigma], [0.1]]).astype(np.float32)


def shuffled(rng: np.random.Generator, *parts: Columns) -> Columns:
    whole = np.concatenate(parts, axis=1)
    return np.ascontiguousarray(whole[:, rng.permutation(whole.shape[1])])


def looked(
    hypotheses: Hypotheses, columns: Columns, times: int = 4, weights: Columns | None = None
) -> Hypotheses:
    count = columns.shape[1]
    equal = np.ones(count, np.float32) if weights is None else weights
    for _ in range(times):
        hypotheses.look(columns, equal, count)
    return hypotheses


def test_two_places_are_two_with_their_own_moments() -> None:
    rng = np.random.default_rng(1)
    columns = shuffled(rng, place(rng, 3000, 0.0, 0.0, 1.0), place(rng, 2000, 5.0, 13.0, -2.0, sigma=0.6))
    hypotheses = looked(Hypotheses(5000, 3), columns)
    first, second = hypotheses.moments(columns, np.ones(5000, np.float32), 5000)
    assert (first.weight, second.weight) == (pytest.approx(0.6), pytest.approx(0.4))
    near, far = columns[:, columns[1] < 6], columns[:, columns[1] > 6]
    for found, own in ((first, near), (second, far)):
        np.testing.assert_allclose(found.mean, own.mean(axis=1, dtype=np.float64), atol=1e-4)
        np.testing.assert_allclose(found.covariance, np.cov(own, bias=True), atol=1e-4)


def _ring(rng: np.random.Generator) -> Columns:
    angle = rng.uniform(-math.pi, math.pi, 4000)
    length = rng.normal(30.0, 0.3, 4000)
    return np.stack([length * np.cos(angle), length * np.sin(angle), angle]).astype(np.float32)


def _banana(rng: np.random.Generator) -> Columns:
    angle = rng.normal(0.0, 0.8, 4000)
    length = rng.normal(30.0, 0.3, 4000)
    return np.stack([length * np.cos(angle), length * np.sin(angle), 0.1 * angle]).astype(np.float32)


def _area(rng: np.random.Generator) -> Columns:
    return (rng.uniform(-1.0, 1.0, (3, 4000)) * [[60.0], [90.0], [math.pi]]).astype(np.float32)


def _tails(rng: np.random.Generator) -> Columns:
    return (rng.standard_t(3, (3, 4000)) * [[1.0], [1.0], [0.1]]).astype(np.float32)


@pytest.mark.parametrize("shape", [_ring, _banana, _area, _tails])
def test_what_is_long_or_wide_is_one(shape: Callable[[np.random.Generator], Columns]) -> None:
    """50 samples of each with weights that differ, four looks at each: none was divided in 3,000 tried."""
    rng = np.random.default_rng(2)
    for _ in range(50):
        columns = shape(rng)
        weights = np.exp(rng.normal(0.0, 1.0, 4000)).astype(np.float32)
        assert looked(Hypotheses(4000, 3), columns, weights=weights).count == 1


def test_one_place_is_one_and_costs_no_label() -> None:
    """A Gaussian whose few particles are worth a hundred: 200 draws, four looks each."""
    rng = np.random.default_rng(3)
    for _ in range(200):
        weights = np.exp(rng.normal(0.0, 1.2, 500)).astype(np.float32)
        hypotheses = looked(Hypotheses(500, 3), place(rng, 500, 0.0, 0.0, sigma=4.0), weights=weights)
        assert not hypotheses.divided


def test_headings_divide_one_place() -> None:
    rng = np.random.default_rng(4)
    columns = shuffled(rng, place(rng, 2000, 0, 0, 3.1), place(rng, 2000, 0, 0, 0.0))
    hypotheses = looked(Hypotheses(4000, 3), columns)
    first, second = hypotheses.moments(columns, np.ones(4000, np.float32), 4000)
    turned = math.remainder(float(first.mean[2] - second.mean[2]), math.tau)
    assert abs(abs(turned) - 3.1) < 0.05
    assert max(first.variance[2], second.variance[2]) < 0.02


def test_a_name_stays_when_the_weights_cross_and_the_leader_is_slow_to_change() -> None:
    """The leader changes once, when another has four times its weight."""
    rng = np.random.default_rng(5)
    columns = shuffled(rng, place(rng, 2000, 0, 0), place(rng, 2000, 0, 14))
    weights = np.ones(4000, np.float32)
    hypotheses = looked(Hypotheses(4000, 3), columns)
    leader = hypotheses.leader
    names = {h.name: round(float(h.mean[1])) for h in hypotheses.moments(columns, weights, 4000)}
    led = names[leader]
    leaders: list[int] = []
    for share in (0.4, 0.6, 0.78, 0.82, 0.9, 0.6, 0.4, 0.25):
        theirs = np.abs(columns[1] - led) > 7
        weights[theirs], weights[~theirs] = 2 * share, 2 * (1 - share)
        looked(hypotheses, columns, 1, weights)
        leaders.append(hypotheses.leader)
        assert {h.name: round(float(h.mean[1])) for h in hypotheses.moments(columns, weights, 4000)} == names
    (other,) = set(names) - {leader}
    assert leaders == [leader] * 3 + [other] * 5


def test_two_that_meet_become_one_and_keep_the_older_name() -> None:
    """Not at the first look, and not while a valley is between them."""
    rng = np.random.default_rng(6)
    here, there = place(rng, 2000, 0, 0, sigma=0.5), place(rng, 2000, 0, 14, sigma=0.5)
    hypotheses = looked(Hypotheses(4000, 3), np.concatenate([here, there], axis=1))
    leader = hypotheses.leader
    for east, count in ((4.0, 2), (0.3, 1)):
        moved = np.concatenate([here, there + np.array([[0.0], [east - 14.0], [0.0]], np.float32)], axis=1)
        looked(hypotheses, np.ascontiguousarray(moved), 6)
        assert hypotheses.count == count
    assert hypotheses.leader == leader
    assert not hypotheses.divided


def lateral(step: float) -> Columns:
    return np.array([[step], [0.0], [0.0]], np.float32)


def test_mirror_images_that_cross_stay_two_by_their_headings() -> None:
    rng = np.random.default_rng(7)
    here, there = place(rng, 2000, -7, 0, 0.8), place(rng, 2000, 7, 0, -0.8)
    hypotheses = looked(Hypotheses(4000, 3), np.concatenate([here, there], axis=1))
    names = sorted(hypotheses.names.values())
    for step in np.linspace(0.0, 14.0, 60, dtype=np.float32):
        both = np.concatenate([here + lateral(step), there - lateral(step)], axis=1)
        looked(hypotheses, np.ascontiguousarray(both, np.float32), 1)
        assert sorted(hypotheses.names.values()) == names


def test_one_without_weight_is_dropped_after_a_while_and_its_strays_may_come_back() -> None:
    rng = np.random.default_rng(8)
    columns = np.concatenate([place(rng, 2000, 0, 0), place(rng, 2000, 0, 14)], axis=1)
    hypotheses = looked(Hypotheses(4000, 3), columns)
    weights = np.ones(4000, np.float32)
    weights[2000:] = 0.5 * DROPPED
    looked(hypotheses, columns, FADES - 1, weights)
    assert hypotheses.count == 2
    looked(hypotheses, columns, 1, weights)
    assert (hypotheses.count, hypotheses.divided) == (1, True)
    (only,) = hypotheses.moments(columns, weights, 4000)
    assert abs(only.mean[1]) < 0.05  # the strays are not in its mean
    weights[2000:] = 1.0
    looked(hypotheses, columns, 1, weights)
    assert hypotheses.count == 2
    assert max(hypotheses.names.values()) == 3
    assert not set(hypotheses.names.values()) >= {1, 2}


def test_the_least_part_is_given_and_the_rest_by_weight() -> None:
    rng = np.random.default_rng(10)
    columns = np.concatenate([place(rng, 500, 0, 0), place(rng, 500, 0, 14)], axis=1)
    hypotheses = looked(Hypotheses(1000, 3), columns)
    weights = np.ones(1000, np.float32)
    weights[500:] = 0.01
    quotas = hypotheses.quotas(weights, 1000, 700)
    least = EVEN_PART / 2
    assert quotas.sum() == 700
    assert quotas[hypotheses.labels[999]] == pytest.approx(700 * least / (least + 1.0 / 1.01), abs=2)


def _started(count: int, seed: int) -> tuple[ParticleFilter[UnicycleControl], Hypotheses]:
    rng = np.random.default_rng(seed)
    belief = ParticleFilter(Unicycle(0.3, 0.0, 0.0, 0.0), capacity=count, seed=seed)
    side = np.where(np.arange(count) % 2 == 0, 1.0, -1.0)
    belief.initialize(
        {
            "north": 7.0 * side + rng.normal(0.0, 0.5, count),
            "east": np.zeros(count),
            "heading": np.zeros(count),
            "gyro_bias": np.zeros(count),
            "odometry_scale": np.ones(count),
        }
    )
    return belief, looked(Hypotheses(count, 5), belief.columns, 2)


def test_the_weights_are_those_of_the_exact_mixture() -> None:
    """Two Kalman filters with their evidence are the exact posterior of two modes; 200 seeds, 20 fixes of 20 m each.

    The log odds err by 0.035 (standard deviation, measured): the mean of 200 lies within 0.015, which is 6 standard
    errors, and none errs by 0.3, which is 8 deviations. No mode dies whose exact weight stays above 1e-3.
    """
    sensor, errors = Position(20.0, outliers=0.0), list[float]()
    for seed in range(200):
        belief, hypotheses = _started(400, seed)
        rng = np.random.default_rng(1000 + seed)
        means, variance, log_odds, alive = np.array([7.0, -7.0]), 0.25, 0.0, True
        for _ in range(20):
            belief.predict(UnicycleControl(0.1, 0.0), 0.2)
            z = float(rng.normal(0.0, 20.0))
            belief.weigh(sensor, PositionMeasurement(z, 0.0))
            means, variance = means + 0.1, variance + 0.3**2 * 0.2
            squares = (z - means) ** 2 / (variance + 400.0)
            log_odds += 0.5 * float(squares[1] - squares[0])
            gain = variance / (variance + 400.0)
            means, variance = means + gain * (z - means), (1.0 - gain) * variance
            belief.normalize()
            hypotheses.look(belief.columns, belief.weights, belief.count)
            if belief.effective_sample_size < 300:
                quotas = hypotheses.quotas(belief.weights, 400, 400)
                belief.resample_by_label(hypotheses.labels, quotas)
            alive = alive and abs(log_odds) < math.log(1 / DROPPED)
        positive = float(belief.weights[belief.column("north") > 0].sum() / belief.weights.sum())
        if alive:
            assert hypotheses.count == 2
            errors.append(math.log(positive / (1.0 - positive)) - log_odds)
    assert len(errors) > 150
    assert max(np.abs(errors)) < 0.3
    assert abs(float(np.mean(errors))) < 0.015


def test_neither_mirror_image_dies_by_lottery() -> None:
    """Two beacons on a line and 200 seeds: after 40 ranges both sides live, though 600 particles stand for them.

    The ranges are the same for both sides, so the exact weights are one half; the log odds' mean over the seeds lies
    within 5 standard errors of zero (false alarm 6e-7).
    """
    sensor, odds = Range(0.5, outliers=0.05), list[float]()
    for seed in range(200):
        belief, hypotheses = _started(600, seed)
        rng = np.random.default_rng(2000 + seed)
        for _ in range(20):
            belief.predict(UnicycleControl(0.0, 0.0), 0.2)
            for east in (-10.0, 20.0):
                reading = math.hypot(7.0, east) + float(rng.normal(0.0, 0.5))
                belief.weigh(sensor, RangeMeasurement(reading, 0.0, east, 0.0))
            belief.normalize()
            hypotheses.look(belief.columns, belief.weights, belief.count)
            if belief.effective_sample_size < 300:
                quotas = hypotheses.quotas(belief.weights, belief.count, 600)
                belief.resample_by_label(hypotheses.labels, quotas)
        positive = float(belief.weights[belief.column("north") > 0].sum() / belief.weights.sum())
        assert hypotheses.count == 2, seed
        odds.append(math.log(positive / (1.0 - positive)))
    assert abs(float(np.mean(odds))) < 5.0 * float(np.std(odds)) / math.sqrt(200)


@pytest.mark.parametrize(("capacity", "dimension"), [(0, 3), (10, 2)])
def test_what_cannot_be_is_refused(capacity: int, dimension: int) -> None:
    with pytest.raises(ValueError, match="hypotheses"):
        Hypotheses(capacity, dimension)
