"""A latency is found where the way bends, as well as is claimed; straight ahead nothing is learned of it."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

from filters import chi_square
from filters.linearised.latency import LATENCY, Late, Lateness
from filters.motion.unicycle import Unicycle, UnicycleControl
from filters.sensing import Position, PositionMeasurement

WILD = math.log(1e-300)
STEP, SPEED, CLAIM, STATED = 0.2, 5.0, 0.4, 0.05
SEEDS = 24


def drive(
    seed: int, turn_rate: float, seconds: float, lasting: float, latency: float | None = None
) -> tuple[float, Late]:
    """Swing left and right; return the true latency, drawn as stated, and what was found of it.

    The oracle is the drive itself: where the vehicle was ``latency`` ago is reckoned on the exact way.
    """
    chance = np.random.default_rng(seed)
    late = STATED * float(chance.normal()) if latency is None else latency
    learner = Lateness(Unicycle(0.05, 0.005, 0.0, 0.0), (), STATED)
    truth = np.zeros(3)
    started = np.array([0.1, 0.1, 0.02])
    learner.begin(
        np.array([*(truth + started * chance.normal(size=3)), 0.0, 1.0]),
        np.diag([*started**2, 1e-10, 1e-10]),
        lasting**2,
    )
    error, kept = lasting * chance.normal(size=2), math.exp(-STEP / 60.0)
    for tick in range(round(seconds / STEP)):
        rate = turn_rate * (1.0 if tick * STEP % 20.0 < 10.0 else -1.0)
        distance = SPEED * STEP + 0.05 * math.sqrt(STEP) * chance.normal()
        turn = rate * STEP + 0.005 * math.sqrt(STEP) * chance.normal()
        middle = truth[2] + 0.5 * turn
        truth += (distance * math.cos(middle), distance * math.sin(middle), turn)
        error = kept * error + math.sqrt(1.0 - kept**2) * lasting * chance.normal(size=2)
        then = truth[2] - 0.5 * rate * late
        fix = truth[:2] - SPEED * late * np.array([math.cos(then), math.sin(then)])
        fix = fix + error + CLAIM * chance.normal(size=2)
        learner.predict(UnicycleControl(SPEED * STEP, rate * STEP), STEP, lasting**2)
        value = PositionMeasurement(float(fix[0]), float(fix[1]), CLAIM, CLAIM, SPEED, rate)
        learner.hear(Position(CLAIM, delay=LATENCY), value, WILD, 0.5)
    return late, learner.late


@cache
def drives(lasting: float) -> tuple[tuple[float, Late], ...]:
    return tuple(drive(seed, 0.3, 60.0, lasting) for seed in range(SEEDS))


@pytest.mark.parametrize("lasting", [0.0, 0.3])
def test_what_is_found_is_as_good_as_it_claims(lasting: float) -> None:
    """The errors over their standard deviations are a chi-square of so many; false alarm 1e-4 on each side."""
    found = drives(lasting)
    squares = sum(((late - said.mean) / said.sigma) ** 2 for late, said in found)
    assert chi_square.quantile(1e-4, SEEDS) < squares < chi_square.quantile(1.0 - 1e-4, SEEDS)
    assert max(said.sigma for _, said in found) < 0.5 * STATED


def test_a_straight_way_tells_a_latency_from_a_lasting_error_only_as_was_stated() -> None:
    _, said = drive(0, 0.0, 60.0, 1.0, 0.05)
    assert 0.75 * STATED < said.sigma <= STATED
    assert abs(said.mean) < 0.5 * STATED


def test_what_was_learned_outlasts_a_new_beginning_and_fades_towards_what_was_stated() -> None:
    learner = Lateness(Unicycle(0.05, 0.005, 0.0, 0.0), (), STATED)
    learner.late = Late(0.03, 0.01)
    mean, covariance = np.array([1.0, 2.0, 0.1, 0.0, 1.0]), np.diag([0.1, 0.1, 0.01, 1e-8, 1e-8])
    learner.begin(mean, covariance, 0.0)
    row = learner.bank.rows[LATENCY]
    np.testing.assert_allclose(learner.bank.mean[:, row], 0.03)
    learner.predict(None, 600.0, 0.0)
    np.testing.assert_allclose(learner.bank.mean[:, row], 0.03 / math.e)
    variance = 0.01**2 / math.e**2 + STATED**2 * (1.0 - 1.0 / math.e**2)
    np.testing.assert_allclose(learner.bank.covariance[:, row, row], variance)
    np.testing.assert_array_equal(learner.mean()[:2], (1.0, 2.0))
    learner.stop()
    assert not learner.live
