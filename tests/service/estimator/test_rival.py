"""A rival of the belief: its ratio against sums worked out, Ville's bound over many of them, and where it is drawn."""

from __future__ import annotations

import math

import numpy as np
import pytest

from filters.sensing import Position, PositionMeasurement, RangeBearing, RangeBearingMeasurement
from service.estimator.hearing import Heard
from service.estimator.measuring import Measurement
from service.estimator.rival import FALSE_ALARM, LEAST_HEARD, LIKELY, TRIAL, Rival
from service.estimator.way import FreeShape


def heard(log_mean: float, surprise: float = 1.0, absolute: bool = True) -> Heard:
    value = PositionMeasurement(0.0, 0.0)
    return Heard(0, Measurement("position", Position(1.0), value, absolute, -9.0, 1.0), log_mean, surprise)


def rival(points: int = 4) -> Rival:
    return Rival({name: np.arange(float(points)) for name in ("north", "east", "heading")}, 0)


def test_the_ratio_is_that_of_the_mean_likelihoods() -> None:
    """Three readings: the product of what the points give, averaged over the points, over the belief's evidence."""
    rng = np.random.default_rng(1)
    logs = rng.normal(-2.0, 1.5, (3, 4))
    beliefs = rng.normal(-3.0, 1.0, 3)
    one = rival()
    for log, belief in zip(logs, beliefs, strict=True):
        one.weigh(log, heard(float(belief)))
    joint = np.exp(logs.sum(axis=0)).mean()
    assert one.log_ratio == pytest.approx(math.log(joint) - beliefs.sum(), rel=1e-12)


def test_a_right_belief_is_beaten_no_oftener_than_ville_says() -> None:
    """4,000 beliefs that are right and rivals 1 sigma off, 40 readings each: L reaches 20 in 5 % at most.

    The count is binomial: 240 would be 2.9 standard deviations above 200.
    """
    rng = np.random.default_rng(2)
    errors = rng.normal(size=(4000, 40))
    ratios = np.cumsum(-0.5 * (errors - 1.0) ** 2 + 0.5 * errors**2, axis=1)
    for number, row in enumerate(errors[:200]):
        one = rival(1)
        for error in row:
            one.weigh(np.array([-0.5 * (error - 1.0) ** 2]), heard(-0.5 * error**2))
        assert one.log_ratio == pytest.approx(ratios[number, -1], abs=1e-9)
    reached = int((ratios.max(axis=1) >= math.log(20.0)).sum())
    assert 0 < reached <= 240


@pytest.mark.parametrize(
    ("readings", "surprise", "advantage", "wins"),
    [
        (LEAST_HEARD, 1.0, 1.01, True),
        (LEAST_HEARD, 1.0, 0.99, False),  # it does not yet predict so much better
        (LEAST_HEARD - 1, 1.0, 1.01, False),  # it has not explained enough
        (LEAST_HEARD, 0.49, 1.01, False),  # the belief explains most of it, too
    ],
)
def test_it_wins_by_all_three(readings: int, surprise: float, advantage: float, wins: bool) -> None:
    one = rival()
    for _ in range(readings):
        one.weigh(np.zeros(4), heard(advantage * math.log(FALSE_ALARM) / readings, surprise))
    one.weigh(np.zeros(4), heard(0.0, 1.0, absolute=False))
    assert one.wins is wins


def test_it_leads_before_it_wins() -> None:
    one = rival()
    for _ in range(LEAST_HEARD):
        one.weigh(np.zeros(4), heard(1.01 * math.log(LIKELY) / LEAST_HEARD))
    assert one.leads
    assert not one.wins
    one.weigh(np.full(4, math.log(LIKELY)), heard(0.0))
    assert not one.leads


def sight(log_mean: float) -> Heard:
    model = RangeBearing(0.2, 0.05, landmarks=[(0.0, 0.0), (9.0, 0.0)])
    return Heard(
        0, Measurement("camera", model, RangeBearingMeasurement(3.0, 0.0), True, -9.0, 1.0), log_mean, 1.0
    )


def test_one_thing_without_a_name_is_not_enough() -> None:
    """Ten sights of 4 nats each: of one landmark, or all but one, they may be of anything; of two in turn, hardly."""
    one = rival()
    for _ in range(10):
        one.weigh(np.array([0.0, -1.0, -1.0, -1.0]), sight(-4.0))
    assert one.wins
    assert one.likeliest == 0
    assert not one.apart(["a"] * 10)
    assert not one.apart([*["a"] * 9, "b"])
    assert one.apart(["a", "b"] * 5)
    named = rival()
    named.weigh(np.zeros(4), heard(-40.0))
    assert named.unnamed == []


def test_it_is_given_up_for_being_worse_or_late() -> None:
    one = rival()
    assert not one.hopeless(TRIAL)
    assert one.hopeless(TRIAL + 1)
    one.weigh(np.full(4, -12.5), heard(0.0))
    assert one.hopeless(0)


def test_it_is_drawn_by_weight_and_carried_along() -> None:
    """Two points, the second with three quarters, 2 s at 1 m/s north with a blur of 0.1 m: each at its own."""
    columns = {
        "north": np.array([0.0, 100.0]),
        "east": np.array([0.0, 10.0]),
        "heading": np.array([0.0, 1.0]),
        "velocity_north": np.ones(2),
        "velocity_east": np.zeros(2),
    }
    one = Rival(columns, 0)
    one.weigh(np.log([0.25, 0.75]), heard(0.0))
    shape = FreeShape(np.array([[2.0]]), np.array([0.01]), np.array([0.0004]), np.zeros(1))
    drawn = one.draw(shape, 4000, np.random.default_rng(3))
    far = drawn["north"] > 50.0
    assert far.mean() == pytest.approx(0.75, abs=0.001)
    assert drawn["north"][far].mean() == pytest.approx(102.0, abs=0.01)
    assert drawn["north"][~far].mean() == pytest.approx(2.0, abs=0.015)
    assert drawn["north"][far].std() == pytest.approx(0.1, rel=0.08)
    assert drawn["heading"][far].mean() == pytest.approx(1.0, abs=0.002)
    assert drawn["heading"][far].std() == pytest.approx(0.02, rel=0.08)
