"""The Kalman filter in the particles' place: what is published meanwhile, and what the particles get back."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np
import pytest
from scipy import stats

from drivers.sample import Odometer, Range, Rotation, Sample
from filters.motion.unicycle import GYRO_BIAS, ODOMETRY_SCALE
from filters.particle import ParticleFilter
from filters.sensing import Range as RangeModel
from filters.sensing import RangeMeasurement
from service.config import Configuration, validated
from service.decisions import UNCUT, Decided
from service.estimate import Estimate
from service.estimator import Cause, Course, Estimator, Level
from service.estimator.deputy import Deputy
from service.estimator.vehicle import vehicle_of

SECOND = 1_000_000_000
COUNT = 4000
BEACONS = {1: (30.0, 30.0), 2: (30.0, -30.0), 3: (-30.0, 30.0)}
RATE = 20
FULL = (Level.FULL, 64)
KALMAN = (Level.KALMAN, 64)

Allowed = Callable[[int], tuple[Level, int]]


def configuration(**start: Any) -> Configuration:
    file: dict[str, Any] = {
        "vehicle": {"name": "test"},
        "start": {"position": [0.0, 0.0, 0.0], "heading": 0.0, **start},
        "motion": {"gyro_bias_sigma": 0.01, "odometry_scale_sigma": 0.02},
        "link": [{"name": "l", "kind": "mavlink", "url": "udpin:127.0.0.1:0"}],
        "sensor": [{"kind": "range", "sigma": 0.3}],
        "beacon": [{"id": i, "position": [*p, 0.0]} for i, p in BEACONS.items()],
    }
    return validated(file, Configuration, "test.toml")


def samples(tick: int, random: np.random.Generator) -> list[Sample]:
    """What a vehicle says that drives north at 1 m/s: odometer and gyro always, one range in every fourth tick."""
    t = tick / RATE
    time = round(t * SECOND)
    said = [Sample(time, time, "l", "S", reading) for reading in (Odometer((t,)), Rotation(0.0))]
    if tick % 4 == 0:
        beacon = tick // 4 % 3 + 1
        n, e = BEACONS[beacon]
        distance = math.hypot(t - n, e) + 0.3 * random.standard_normal()
        said.append(Sample(time, time, "l", "S", Range(beacon, distance)))
    return said


def drive(allowed: Allowed, seconds: float, seed: int = 0, **start: Any) -> list[Estimate]:
    """Run an estimator with what ``allowed`` says of every tick."""
    random = np.random.default_rng(seed)
    estimator = Estimator(configuration(**start), seed=seed)
    estimates: list[Estimate] = []
    for tick in range(round(seconds * RATE)):
        level, most = allowed(tick)
        estimator.ingest(samples(tick, random))
        course = Course(level, Cause.NONE if level is Level.FULL else Cause.BUDGET, most)
        now = round(tick / RATE * SECOND)
        estimates.append(estimator.tick(now, now, 2000, course))
    return estimates


def error(estimate: Estimate) -> float:
    assert estimate.position[0] is not None
    assert estimate.position[1] is not None
    return math.hypot(estimate.position[0] - estimate.time, estimate.position[1])


def between(first: int, last: int) -> Allowed:
    return lambda tick: KALMAN if first <= tick < last else FULL


def test_speaks_as_level_four_and_gives_the_belief_back() -> None:
    """Twenty seconds of particles, of the Kalman filter, and of particles again: never 1 m off, always inside 3 radii.

    The ranges' sigma of 0.3 m bounds the error of any of them far below a metre.
    """
    estimates = drive(between(20 * RATE, 40 * RATE), 60.0)
    before, during, after = (estimates[k * 20 * RATE : (k + 1) * 20 * RATE] for k in range(3))
    assert {estimate.level for estimate in during} == {4}
    assert {estimate.particles for estimate in during} == {0}
    assert {estimate.effective_sample_size for estimate in during} == {None}
    assert all("a Kalman filter speaks" in estimate.level_reason for estimate in during)
    assert {estimate.level for estimate in before[10:]} | {estimate.level for estimate in after} <= {0, 1}
    assert min(estimate.particles for estimate in after) > 0
    for estimate in estimates[RATE:]:
        assert error(estimate) < 1.0
        assert error(estimate) < 3.0 * (estimate.radius95 or 0.0)
    step = math.dist(during[-1].position[:2], after[0].position[:2])  # type: ignore[arg-type]
    assert step < 0.3  # a tick's way is 0.05 m: the rest is what 200 particles' mean scatters


def test_takes_every_measurement() -> None:
    """With the Kalman filter the error stays where particles have it; with prediction only it grows."""
    deputised = drive(between(10 * RATE, 10**9), 60.0)
    predicted = drive(lambda tick: (Level.PREDICTION_ONLY, 0) if tick >= 10 * RATE else FULL, 60.0)
    assert (deputised[-1].radius95 or math.inf) < 0.5 * (predicted[-1].radius95 or 0.0)


def test_without_a_heading_to_linearise_at_it_only_predicts() -> None:
    """The start has any heading; the first range does not tell it."""
    estimates = drive(lambda tick: KALMAN, 4.0, sigma_heading=math.pi)
    last = estimates[-1]
    assert last.level == Level.PREDICTION_ONLY
    assert last.particles > 0
    assert "only predicted" in last.level_reason


def test_the_same_course_gives_the_same_bytes_and_so_does_its_log() -> None:
    def logged(tick: int) -> tuple[Level, int]:
        level, most = between(100, 200)(tick)
        again = Decided(tick, 0, 0, 2000, level, Cause.BUDGET, most, UNCUT, 0, ()).course()
        return again.level, again.most

    runs = [drive(allowed, 15.0) for allowed in (between(100, 200), between(100, 200), logged)]
    assert msgspec.json.encode(runs[0]) == msgspec.json.encode(runs[1]) == msgspec.json.encode(runs[2])


@pytest.fixture
def pair() -> tuple[Deputy, ParticleFilter[Any]]:
    """A deputy and its particles: correlated, with a marginalised bias and scale."""
    vehicle = vehicle_of(configuration())
    belief = ParticleFilter[Any](vehicle.motion, capacity=COUNT, seed=3)
    random = np.random.default_rng(5)
    normals = random.standard_normal((5, COUNT))
    columns = [3.0 + normals[0], -2.0 + 0.6 * normals[0] + 0.8 * normals[1], 0.4 + 0.1 * normals[2]]
    columns += [0.002 * normals[3], 1.0 + 0.01 * normals[4]]
    belief.initialize(
        dict(zip(("north", "east", "heading", GYRO_BIAS, ODOMETRY_SCALE), columns, strict=True))
    )
    return Deputy(vehicle, belief, seed=7), belief


def test_hands_back_the_gaussian_that_it_took(pair: tuple[Deputy, ParticleFilter[Any]]) -> None:
    """Mean and covariance survive, to sampling: each of ten figures within 4.5 sigma, false alarms 7 in 10^5.

    The variance of a mean is V / n, that of a variance 2 V² / n.
    """
    deputy, belief = pair
    before = belief.moments()
    assert deputy.take_over()
    deputy.hand_back(COUNT)
    after = belief.moments()
    limit = stats.norm.isf(3.4e-6)
    assert not deputy.speaking
    assert np.all(np.abs(after.mean - before.mean) <= limit * np.sqrt(before.variance / COUNT))
    assert np.all(
        np.abs(after.variance - before.variance) <= limit * before.variance * math.sqrt(2 / COUNT) + 1e-12
    )
    assert after.pose_covariance[0, 1] == pytest.approx(
        before.pose_covariance[0, 1], abs=limit * 1.2 / COUNT**0.5
    )


def test_counts_what_its_gate_keeps_out_as_an_outlier_and_refuses_what_is_invalid(
    pair: tuple[Deputy, ParticleFilter[Any]],
) -> None:
    deputy, _ = pair
    assert deputy.take_over()
    model = RangeModel(0.3)
    far = deputy.weigh(model, RangeMeasurement(900.0, 30.0, 30.0))
    assert far.accepted
    assert far.log_mean < -1000.0
    assert not deputy.weigh(model, RangeMeasurement(-1.0, 30.0, 30.0)).accepted
    assert not deputy.weigh(model, RangeMeasurement(math.inf, 30.0, 30.0)).accepted


def test_steps_down_when_the_particles_begin_anew(pair: tuple[Deputy, ParticleFilter[Any]]) -> None:
    deputy, belief = pair
    assert deputy.take_over()
    deputy.started(0)
    columns = belief.columns.copy()
    deputy.hand_back(COUNT)
    assert np.array_equal(columns, belief.columns)
