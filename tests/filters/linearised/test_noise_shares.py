"""Shares of the stated noise are found where they are known, within bounds; the densities against the kernel's own."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from filters.kernels.noise_shares import learn, learn_wandering, log_densities
from filters.linearised.bank import GaussianBank
from filters.linearised.noise_shares import SENSOR_SHARES, NoiseShares, SensorShare
from filters.motion.unicycle import Unicycle, UnicycleControl
from filters.sensing import Position, PositionMeasurement, Range, RangeMeasurement

MOTION = Unicycle(0.1, 0.05, 1e-5, 1e-5)
BEACONS = ((40.0, 0.0), (0.0, 40.0), (-40.0, 0.0), (0.0, -40.0))
STEP = 0.1
OUTLIER = math.log(0.01 / 200.0)


def driven(
    seed: int, seconds: float, turn: float, distance: float, sensor: float = 1.0
) -> tuple[NoiseShares, float, float, float]:
    """Circle among beacons; the arguments are shares of the stated standard deviations that the truth has."""
    chance = np.random.default_rng(seed)
    shares, own = NoiseShares(MOTION), SensorShare()
    truth = np.array([0.0, 0.0, 0.3])
    shares.begin(np.array([*truth, 0.0, 1.0]), np.diag([0.01, 0.01, 1e-3, 1e-6, 1e-6]))
    for step in range(round(seconds / STEP)):
        d = 1.5 * STEP + distance * 0.1 * math.sqrt(STEP) * chance.normal()
        t = 0.1 * STEP + turn * 0.05 * math.sqrt(STEP) * chance.normal()
        truth += (d * math.cos(truth[2] + 0.5 * t), d * math.sin(truth[2] + 0.5 * t), t)
        shares.predict(UnicycleControl(1.5 * STEP, 0.1 * STEP), STEP)
        north, east = BEACONS[step % 4]
        measured = math.hypot(truth[0] - north, truth[1] - east) + sensor * 0.1 * chance.normal()
        value = RangeMeasurement(measured, north, east, 0.0, 0.1)
        shares.hear(Range(0.1), value, OUTLIER, 1.0, own, STEP)
        if step % 10 == 9:
            shares.pass_second()
    return shares, *shares.reckon(), own.expected


@pytest.mark.parametrize("seed", range(2))
def test_what_is_as_stated_is_left_alone(seed: int) -> None:
    _, turn, distance, sensor = driven(seed, 60.0, 1.0, 1.0)
    assert 0.4 < turn < 2.5
    assert 0.4 < distance < 2.5
    assert 0.6 < sensor < 1.5


@pytest.mark.parametrize("seed", range(2))
def test_each_noise_is_found_by_itself(seed: int) -> None:
    _, turn, distance, sensor = driven(seed, 90.0, 0.1, 1.0)
    assert turn < 0.3
    assert distance > 0.5
    assert 0.6 < sensor < 1.5
    _, turn, distance, sensor = driven(seed, 90.0, 1.0, 0.25)
    assert turn > 0.4
    assert 0.25 <= distance < 0.45
    assert 0.6 < sensor < 1.5


@pytest.mark.parametrize("seed", range(2))
def test_a_sensor_that_is_better_than_it_says_does_not_make_the_motion_exact(seed: int) -> None:
    _, turn, distance, sensor = driven(seed, 90.0, 1.0, 1.0, sensor=0.25)
    assert sensor < 0.2
    assert turn > 0.4
    assert distance > 0.5


def test_worse_than_stated_is_found_too_and_within_bounds() -> None:
    _, turn, distance, _ = driven(5, 60.0, 2.5, 3.0)
    assert 1.5 < turn <= 4.0
    assert 2.0 < distance <= 16.0


def test_nothing_is_learned_before_it_begins_and_what_was_learned_stays() -> None:
    shares = NoiseShares(MOTION)
    shares.predict(UnicycleControl(1.0, 0.0), 1.0)
    shares.hear(Range(0.1), RangeMeasurement(3.0, 0.0, 0.0, 0.0, 0.1), OUTLIER, 1.0)
    shares.pass_second()
    assert shares.reckon() == (pytest.approx(1.0, abs=0.1), pytest.approx(1.0, abs=0.1))
    assert shares.belief.sum() == pytest.approx(1.0)
    shares = driven(1, 60.0, 0.1, 1.0)[0]
    known = shares.reckon()
    shares.stop()
    for _ in range(5):
        shares.pass_second()
    assert shares.reckon() == known
    assert known[0] < 0.5


def test_errors_that_wander_do_not_pass_for_a_vehicle_that_does() -> None:
    """A receiver that wanders by 1 m, told to be independent or not, of a vehicle that is as good as stated."""

    def learned(own: SensorShare | None) -> float:
        chance = np.random.default_rng(3)
        shares, off, north = NoiseShares(MOTION), np.zeros(2), 0.0
        shares.begin(np.array([0.0, 0.0, 0.0, 0.0, 1.0]), np.diag([0.01, 0.01, 1e-3, 1e-6, 1e-6]))
        for _ in range(100):
            north += 1.5
            off += 0.5 * chance.standard_normal(2) - 0.1 * off
            shares.predict(UnicycleControl(1.5, 0.0), 1.0)
            value = PositionMeasurement(north + off[0], off[1], 0.1, 0.1)
            shares.hear(Position(0.1), value, math.log(1e-8), 1.0, own, 0.0)
            shares.pass_second()
        return shares.reckon()[1]

    assert learned(SensorShare()) > 8.0
    assert learned(None) < 5.0


def test_motion_and_sensor_learn_of_each_other_by_bayes_rule() -> None:
    """Both marginals of one table, the second by what the first has become."""
    chance = np.random.default_rng(1)
    table, motion, sensor = chance.normal(size=(4, 3)), np.log(np.full(4, 0.25)), np.log([0.5, 0.3, 0.2])
    prior, weight, own_weight, forgotten = np.array([0.2, 0.6, 0.2]), 0.5, 0.3, 0.01
    expected = np.exp(motion) * (np.exp(table) @ np.exp(sensor)) ** weight
    expected /= expected.sum()
    own = np.exp(sensor) * (expected @ np.exp(table)) ** own_weight
    own = (1.0 - forgotten) * own / own.sum() + forgotten * prior
    assert learn(table, weight, motion, sensor, own_weight, prior, forgotten)
    np.testing.assert_allclose(np.exp(motion), expected, rtol=1e-12)
    np.testing.assert_allclose(np.exp(sensor), own, rtol=1e-12)
    table[1, :] = -math.inf  # impossible under one of them: of no use to anyone
    assert not learn(table, weight, motion, sensor, own_weight, prior, forgotten)
    np.testing.assert_allclose(np.exp(motion), expected, rtol=1e-12)


def test_who_wanders_never_makes_more_noise_likelier_than_what_is_stated() -> None:
    logs, motion = np.array([3.0, 5.0, 2.0, 1.0, -1.0, 4.0]), np.log(np.full(6, 1 / 6))
    learn_wandering(logs, -math.inf, 1.0, 3, motion)
    bounded = np.array([1.0, -1.0, 2.0, -1.0, -1.0, 4.0])
    bounded[0] = min(bounded[0], bounded[1])
    np.testing.assert_allclose(np.exp(motion), np.exp(bounded) / np.exp(bounded).sum(), rtol=1e-12)


@pytest.mark.parametrize("measured", [1, 2])
def test_densities_of_every_share_are_those_of_the_bank(measured: int) -> None:
    """The kernel weighs one component after the other, these at once: two ways to the same number."""
    chance = np.random.default_rng(measured)
    bank = GaussianBank(MOTION, (), 3)
    for member in range(3):
        root = 0.2 * chance.standard_normal((5, 5))
        bank.set(member, np.array([*chance.normal(size=3), 0.0, 1.0]), root @ root.T + 0.01 * np.eye(5))
    sensor: Any = Range(0.3) if measured == 1 else Position(0.5)
    value: Any = (
        RangeMeasurement(21.0, 20.0, 5.0, 0.0, 0.3)
        if measured == 1
        else PositionMeasurement(0.5, 1.0, 0.5, 0.8)
    )
    expected = bank.expect(sensor, value)
    table = np.empty((3, SENSOR_SHARES.size))
    log_densities(bank.covariance, *expected, SENSOR_SHARES, -math.inf, table)
    for column, share in enumerate(SENSOR_SHARES):
        scaled = expected._replace(noise=share * expected.noise)
        said = bank.correct(scaled, bank.live, 0.0)
        np.testing.assert_allclose(table[:, column], said.log_evidence, rtol=1e-9)
