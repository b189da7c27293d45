"""Figure 4.5: five densities of one particle set, against the exact one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from filters.textbook import transform
from filters.textbook.extraction import extraction


def test_each_density_is_a_density_and_nears_the_truth() -> None:
    """All integrate to one; with a hundred times the particles those that can follow the truth do."""
    few, many = extraction(100), extraction(10_000)
    step = float(few.y[1] - few.y[0])
    for shown in (few, many):
        assert set(shown.densities) == {"gaussian", "mixture", "histogram", "tree", "kernel"}
        for curve in shown.densities.values():
            assert float(curve.sum()) * step == pytest.approx(1.0, abs=0.02)
    for name in ("histogram", "tree", "kernel"):
        assert many.error[name] < 0.06
        assert many.error[name] < few.error[name]
    assert many.error["gaussian"] > 0.15  # it keeps two numbers, however many particles there are
    assert many.numbers["gaussian"] == 2


def test_the_curves_are_what_they_say() -> None:
    shown = extraction(50)
    np.testing.assert_array_equal(shown.exact, transform.density(shown.y))
    mean, variance = transform.moments()
    np.testing.assert_allclose(shown.exact_gaussian, stats.norm.pdf(shown.y, mean, variance**0.5), rtol=1e-12)
    expected = stats.norm.pdf(shown.y, shown.particles.mean(), shown.particles.std())
    np.testing.assert_allclose(shown.densities["gaussian"], expected, rtol=1e-9)
    assert shown.numbers["kernel"] == 50


@pytest.mark.parametrize(("count", "points"), [(9, 100), (100, 1)])
def test_too_few_are_refused(count: int, points: int) -> None:
    with pytest.raises(ValueError, match="at least"):
        extraction(count, points)
