"""A dispute between a receiver and the way: heard where it is one, never where both are right but for once in 100."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import chi2

from drivers.sample import SECOND
from filters.sensing import Position, PositionMeasurement, Range, RangeMeasurement
from service.estimator.dispute import LASTING, MEMORY, USUAL, Dispute
from service.estimator.measuring import Measurement

SPREAD = np.array([[4.0, 1.5], [1.5, 1.0]])


def fix(sigma: float) -> Measurement:
    value = PositionMeasurement(1.0, 2.0, sigma)
    return Measurement("position/l", Position(0.3), value, True, math.log(1e-8), 1.0, 0.0, True, 0.0)


def test_estimates_that_are_both_right_are_in_dispute_once_in_a_hundred_times() -> None:
    """3,000 draws: 5 standard deviations of the binomial about chi-square's share."""
    draws = np.random.default_rng(1).multivariate_normal(np.zeros(2), SPREAD, 3000)
    share = 0.0
    for away in draws:
        dispute = Dispute()
        dispute.hear(away, SPREAD)
        share += dispute.held.any() / len(draws)
    expected = chi2.sf(USUAL, 2)
    assert expected == pytest.approx(0.01, abs=1e-3)
    assert share == pytest.approx(expected, abs=5 * math.sqrt(expected / len(draws)))


def test_the_region_then_reaches_to_both() -> None:
    """Published is the belief and what is held: the other estimate lies within two standard deviations of it."""
    dispute = Dispute()
    away = np.array([30.0, -12.0])
    dispute.hear(away, SPREAD)
    assert away @ np.linalg.solve(dispute.held + 0.01 * np.eye(2), away) <= 4.0
    dispute.hear(0.5 * away, SPREAD)
    assert away @ np.linalg.solve(dispute.held + 0.01 * np.eye(2), away) <= 4.0
    np.testing.assert_allclose(dispute.held, dispute.held.T)


def test_it_fades_and_can_be_settled() -> None:
    dispute = Dispute()
    dispute.hear(np.array([30.0, -12.0]), SPREAD)
    before = dispute.held.copy()
    for _ in range(100):
        dispute.wait(MEMORY / 100.0)
    np.testing.assert_allclose(dispute.held, before / math.e)
    dispute.settle()
    assert not dispute.held.any()


@pytest.mark.parametrize("rate", [1, 5, 10])
def test_the_fixes_of_a_minute_weigh_as_one_whose_error_is_what_is_in_dispute(rate: int) -> None:
    dispute = Dispute()
    dispute.hear(np.array([30.0, 0.0]), np.eye(2))
    information = 0.0
    for index in range(int(LASTING) * rate):
        value = dispute.sized((1 + index) * SECOND // rate, fix(0.01)).value
        assert isinstance(value, PositionMeasurement)
        assert value.sigma_north is not None
        information += 1.0 / value.sigma_north**2
    assert 1.0 / information == pytest.approx(0.5 * np.trace(dispute.held), rel=0.02)


def test_a_belief_that_knows_less_takes_a_fix_and_ends_as_uncertain_as_the_receiver_is_disputed() -> None:
    """Fix by fix in a Kalman filter of one axis: the variance comes down to what is held, and no lower."""
    dispute = Dispute()
    dispute.hear(np.array([30.0, 0.0]), np.eye(2))
    lasting = 0.5 * float(np.trace(dispute.held))
    variance = 100.0 * lasting
    for index in range(10):
        dispute.variance = variance
        value = dispute.sized((1 + index) * SECOND // 5, fix(0.01)).value
        assert isinstance(value, PositionMeasurement)
        assert value.sigma_north is not None
        variance = 1.0 / (1.0 / variance + 1.0 / value.sigma_north**2)
        assert 0.95 * lasting <= variance <= 1.01 * lasting


def test_what_is_not_disputed_and_what_is_no_fix_stays_as_it_is() -> None:
    dispute = Dispute()
    honest = fix(0.3)
    assert dispute.sized(SECOND, honest) is honest
    dispute.hear(np.array([30.0, 0.0]), np.eye(2))
    value = RangeMeasurement(10.0, 0.0, 0.0)
    reading = Measurement("range/l", Range(0.3), value, True, math.log(1e-8), 1.0, 0.0, True, 0.0)
    assert dispute.sized(SECOND, reading) is reading
