"""A run of outliers: the Beta-Bernoulli model's closed form, false alarms, and how soon it tells."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import betaln

from filters.outlier_run import OutlierRun

DOUBT = 0.02


def surprise_of(relative: float, stated: float) -> float:
    """The probability of an outlier, where what is none is ``relative`` times as dense as outliers (Bayes' rule)."""
    return stated / (stated + (1.0 - stated) * relative)


def needed(stated: float, worth: float = 1.0) -> int:
    """How many outliers in a row reach the doubt."""
    run = OutlierRun()
    for count in range(1, 100_000):
        run.observe(1.0, stated, worth)
        if run.log_odds >= -math.log(DOUBT):
            return count
    raise AssertionError("never")


@pytest.mark.parametrize("stated", [0.01, 0.05, 0.4, 0.8])
def test_outliers_in_a_row_have_the_probability_of_the_beta_bernoulli_model(stated: float) -> None:
    """P(k outliers) = B(a + k, b) / B(a, b), with a the stated share and a + b = 1."""
    run = OutlierRun()
    for count in range(1, 200):
        run.observe(1.0, stated)
        assert run.log_odds == pytest.approx(
            betaln(stated, 1.0 - stated) - betaln(stated + count, 1.0 - stated), abs=1e-4 * count
        )


def test_one_reading_is_weighed_by_what_both_say_of_it() -> None:
    for stated, relative in ((0.05, 0.3), (0.4, 0.01), (0.2, 0.9)):
        run = OutlierRun()
        run.observe(surprise_of(relative, stated), stated)
        assert run.log_odds == pytest.approx(-math.log(stated + (1.0 - stated) * relative))


def test_outliers_prove_something_where_they_are_rare() -> None:
    """One where a hundredth are, three where a twentieth are, but 180 independent ones where two fifths are."""
    assert needed(0.01) == 1
    assert needed(0.05) == 3
    assert 15 <= needed(0.2) <= 25
    assert 150 <= needed(0.4) <= 200


def test_sights_of_one_thing_are_worth_less() -> None:
    assert needed(0.05, 0.1) > 5 * needed(0.05)
    run = OutlierRun()
    run.observe(1.0, 0.05, 0.0)
    assert run.log_odds == 0.0


def test_what_fits_ends_the_run() -> None:
    run = OutlierRun()
    for _ in range(3):
        run.observe(1.0, 0.05)
    for _ in range(3):
        run.observe(surprise_of(50.0, 0.05), 0.05)
    assert run.log_odds == 0.0
    run.observe(1.0, 0.05)
    assert run.log_odds == pytest.approx(math.log(20.0), rel=1e-6)


@pytest.mark.parametrize("stated", [0.05, 0.4])
def test_a_right_belief_is_seldom_doubted(stated: float) -> None:
    """Ville: the odds reach 1 / a in a run with at most a = 2 %, whatever the share drawn for it.

    2,000 runs; beyond 2 % + 4 standard errors (1.25 %) comes up once in 30,000 if the bound holds with equality.
    """
    random = np.random.default_rng(11)
    alarms = 0
    for share in random.beta(stated, 1.0 - stated, 2000):
        run = OutlierRun()
        for _ in range(60):
            density = 0.02 if random.random() < share else math.exp(-0.5 * random.standard_normal() ** 2)
            relative = 0.0 if density == 0.02 else density / math.sqrt(2.0 * math.pi) / 0.02
            run.observe(surprise_of(relative, stated), stated)
            if run.log_odds == 0.0:
                break
            if run.log_odds >= -math.log(DOUBT):
                alarms += 1
                break
    assert alarms <= 2000 * 0.02 + 4.0 * math.sqrt(2000 * 0.02 * 0.98)


@pytest.mark.parametrize(
    ("surprise", "stated", "worth"),
    [(-0.1, 0.05, 1.0), (math.nan, 0.05, 1.0), (0.5, 0.0, 1.0), (0.5, 0.05, 1.1)],
)
def test_refuses_what_is_no_probability(surprise: float, stated: float, worth: float) -> None:
    with pytest.raises(ValueError, match="outlier run"):
        OutlierRun().observe(surprise, stated, worth)
