"""The alarm: raised where every kind of absolute sensor contradicts the belief, and not by one of them."""

from __future__ import annotations

import math

import numpy as np

from drivers.sample import SECOND
from filters.belief import Moments
from filters.sensing import Position, PositionMeasurement, Range, RangeMeasurement
from service.estimator.alarm import SILENCE, Alarm
from service.estimator.hearing import Heard
from service.estimator.measuring import Measurement

NAMES = ("north", "east", "heading")
BELIEF = Moments(NAMES, np.zeros(3), np.diag([0.04, 0.04, 0.01]), np.array([0.04, 0.04, 0.01]), 1000.0)
FIX = Measurement("position/a", Position(1.0), PositionMeasurement(0.0, 0.0), True, -9.0, 1.0)
REACH = Measurement("range/b/4", Range(0.5), RangeMeasurement(30.0, 30.0, 0.0), True, -5.0, 1.0)
RIGHT = {
    FIX.name: -math.log(2.0 * math.pi * math.e * 1.04),
    REACH.name: -0.5 * math.log(2.0 * math.pi * math.e * 0.29),
}
"""The log density that the belief gives on average to what it expects: the negative entropy of a Gaussian."""
WRONG = -30.0


def watched() -> Alarm:
    alarm = Alarm()
    alarm.moments = BELIEF
    return alarm


def hear(alarm: Alarm, measured: Measurement, log_mean: float, times: range) -> None:
    for second in times:
        alarm.observe(Heard(second * SECOND, measured, log_mean, 0.0))


def test_a_belief_that_explains_what_it_hears_raises_none() -> None:
    alarm = watched()
    hear(alarm, FIX, RIGHT[FIX.name], range(60))
    assert not alarm.raised


def test_every_kind_must_contradict() -> None:
    """Fixes alone do not raise it while ranges agree; both do; and without moments nothing is said."""
    alarm, blind = watched(), Alarm()
    for second in range(12):
        hear(alarm, REACH, RIGHT[REACH.name], range(second, second + 1))
        hear(alarm, FIX, WRONG, range(second, second + 1))
        hear(blind, FIX, WRONG, range(second, second + 1))
    assert not alarm.raised
    hear(alarm, FIX, WRONG, range(12, 16))
    hear(alarm, REACH, WRONG, range(12, 24))
    assert alarm.raised
    assert not blind.raised


def test_who_has_fallen_silent_has_no_say() -> None:
    alarm = watched()
    hear(alarm, REACH, RIGHT[REACH.name], range(10))
    hear(alarm, FIX, WRONG, range(10, 10 + SILENCE // SECOND))
    assert not alarm.raised
    hear(alarm, FIX, WRONG, range(20, 22))
    assert alarm.raised
