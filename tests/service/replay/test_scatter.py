"""What the ranges of a log are worth, beside what they were made of."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drivers.sample import Range
from service.replay.scatter import RangeScatter


def scattered(
    correlated: float,
    claim: float | None,
    *,
    outliers: float = 0.0,
    seconds: float = 200.0,
    speed: float = 1.0,
) -> RangeScatter:
    """Ranges to two beacons, 10 a second, of a tag on a line, whose errors are drawn anew each second."""
    random = np.random.default_rng(7)
    scatter = RangeScatter()
    for beacon in (1, 2):
        errors = correlated * random.standard_normal(round(seconds) + 1)
        for index in range(round(seconds * 10)):
            t = index / 10.0
            distance = 5.0 + speed * t + errors[int(t)]
            distance += random.exponential(5.0) if random.uniform() < outliers else 0.0
            scatter.add(round(t * 1e9), Range(beacon, distance, sigma=claim))
    return scatter


@pytest.mark.parametrize("outliers", [0.0, 0.02])
def test_errors_that_last_a_second_are_one_a_second(outliers: float) -> None:
    """0.05 m each second, in ten readings; √15 times as much each, to 15 % (three standard errors of 400 draws)."""
    sigma = scattered(0.05, 0.3, outliers=outliers).sigma()
    assert sigma == pytest.approx(0.05 * math.sqrt(15.0), rel=0.15)


def test_a_claim_is_doubted_by_a_factor_of_two_at_most() -> None:
    assert scattered(0.001, 0.3).sigma() == 0.15


def test_a_claim_that_is_too_small_is_left_to_itself() -> None:
    assert scattered(0.5, 0.3).sigma() is None


def test_without_claims_or_with_few_readings_nothing_is_said() -> None:
    assert RangeScatter().sigma() is None
    assert scattered(0.05, None).sigma() is None
    assert scattered(0.05, 0.3, seconds=4.0).sigma() is None
