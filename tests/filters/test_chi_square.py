"""Chi-square against scipy, to ten digits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from filters import chi_square


@pytest.mark.parametrize("degrees", [1, 2, 3, 4, 6, 9, 20, 200])
def test_it_is_scipys(degrees: int) -> None:
    for probability in (1e-6, 0.01, 0.5, 0.95, 0.999, 1 - 1e-9):
        value = chi_square.quantile(probability, degrees)
        # the last digits of a probability near one say little of the value: 1e-10 relative there too
        assert value == pytest.approx(stats.chi2.ppf(probability, degrees), rel=1e-6)
        assert chi_square.cumulative(value, degrees) == pytest.approx(probability, abs=1e-14, rel=1e-10)
    for value in np.geomspace(1e-3, 1e3, 61):
        expected = stats.chi2.cdf(value, degrees)
        assert chi_square.cumulative(float(value), degrees) == pytest.approx(expected, rel=1e-10, abs=1e-15)


def test_the_ends_of_its_range() -> None:
    assert chi_square.cumulative(0.0, 3) == 0.0
    assert chi_square.cumulative(-1.0, 3) == 0.0
    assert chi_square.cumulative(math.inf, 3) == 1.0


@pytest.mark.parametrize(("value", "degrees"), [(1.0, 0), (math.nan, 1)])
def test_what_is_no_chi_square_is_refused(value: float, degrees: int) -> None:
    with pytest.raises(ValueError, match="chi-square"):
        chi_square.cumulative(value, degrees)


@pytest.mark.parametrize(("probability", "degrees"), [(0.0, 1), (1.0, 1), (math.nan, 1), (0.5, 0)])
def test_what_has_no_quantile_is_refused(probability: float, degrees: int) -> None:
    with pytest.raises(ValueError, match="chi-square"):
        chi_square.quantile(probability, degrees)
