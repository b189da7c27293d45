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


@pytest.mark.parametrize(("memory", "false_alarms"), [(1.5, 0.05), (4.0, 0.05)])
def test_an_exact_filter_is_inside_in_so_many_runs(memory: float, false_alarms: float) -> None:
    """A random walk on two axes, measured and filtered by the Kalman filter that knows its noises.

    120 s at 50 Hz, 300 runs, an error that lasts ``memory`` seconds. The number outside is binomial; three of its
    standard deviations either way are passed by one in 370, and this seed is as good as any.
    """
    random, runs, step = np.random.default_rng(7), 300, 0.02
    walk, noise = step / memory**2, 1.0 / step
    before = 0.5 * (walk + np.sqrt(walk**2 + 4.0 * walk * noise))
    gain = before / (before + noise)
    variance = (1.0 - gain) * before
    error = np.sqrt(variance) * random.standard_normal((runs, 2))
    nees = np.empty((6000, runs))
    for row in nees:
        moved = error + np.sqrt(walk) * random.standard_normal((runs, 2))
        error = (1.0 - gain) * moved + gain * np.sqrt(noise) * random.standard_normal((runs, 2))
        row[:] = (error**2).sum(axis=1) / variance
    outside = 0
    for run in nees.T:
        low, high = bounds(independent(run))
        outside += not low <= run.mean() <= high
    assert abs(outside - false_alarms * runs) < 3.0 * np.sqrt(runs * false_alarms * (1.0 - false_alarms))
