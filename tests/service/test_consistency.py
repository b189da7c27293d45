"""How many independent samples a series is worth, and the bounds of a mean NEES, beside closed forms and scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from service.consistency import bounds, independent


def test_white_noise_is_worth_its_length() -> None:
    """20,000 draws: the estimate of the autocorrelation time has a relative spread of a few percent."""
    white = np.random.default_rng(1).chisquare(2, 20_000)
    assert independent(white) == pytest.approx(20_000, rel=0.1)


@pytest.mark.parametrize("memory", [0.9, 0.98])
def test_an_autoregression_is_worth_its_closed_form(memory: float) -> None:
    """n (1 - a) / (1 + a); within a third of it, five times the spread over seeds."""
    random = np.random.default_rng(2)
    steps = random.standard_normal(40_000)
    series = np.zeros(40_000)
    for index in range(1, 40_000):
        series[index] = memory * series[index - 1] + steps[index]
    assert independent(series) == pytest.approx(40_000 * (1 - memory) / (1 + memory), rel=0.33)


def test_what_never_changes_is_worth_one_sample_and_short_ones_what_they_are() -> None:
    assert independent(np.full(1000, 3.0)) == 1.0
    assert independent(np.array([1.0, 2.0])) == 2.0


@pytest.mark.parametrize("samples", [1, 10, 300])
def test_the_bounds_are_chi_squares(samples: int) -> None:
    low, high = bounds(samples)
    assert low == pytest.approx(stats.chi2(2 * samples).ppf(0.025) / samples)
    assert high == pytest.approx(stats.chi2(2 * samples).ppf(0.975) / samples)
