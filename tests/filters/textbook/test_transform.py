"""The standard example against quadrature and numerical differentiation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from filters.textbook import normal, transform


@given(st.floats(-50.0, 50.0))
def test_the_inverse_undoes_the_function(x: float) -> None:
    assert float(transform.inverse(transform.function(x))) == pytest.approx(x, abs=1e-13)


def test_the_slope_is_the_functions() -> None:
    x = np.linspace(-3.0, 5.0, 400)
    numerical = (transform.function(x + 1e-5) - transform.function(x - 1e-5)) / 2e-5
    np.testing.assert_allclose(transform.slope(x), numerical, atol=1e-9)
    assert transform.slope(x).min() > 0.39


def test_the_density_integrates_to_the_cumulative() -> None:
    for low, high in ((-2.0, 0.1), (0.1, 1.2), (1.2, 1.9), (-2.0, 4.0)):
        nodes, weights = np.polynomial.legendre.leggauss(400)
        found = (
            0.5 * (high - low) * float(weights @ transform.density(low + 0.5 * (high - low) * (nodes + 1.0)))
        )
        expected = float(transform.cumulative(high) - transform.cumulative(low))
        assert found == pytest.approx(expected, abs=1e-10)


def test_the_moments_are_those_of_quadrature() -> None:
    """Gauss and Hermite's rule of 150 points in x."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(150)
    y = transform.function(transform.MEAN + transform.SIGMA * nodes)
    weights = weights / weights.sum()
    mean = float(weights @ y)
    np.testing.assert_allclose(transform.moments(), (mean, float(weights @ (y - mean) ** 2)), rtol=1e-13)


def test_samples_are_pairs_of_x_and_its_image() -> None:
    x, y = transform.sample(100, np.random.default_rng(1))
    np.testing.assert_array_equal(y, transform.function(x))


def test_the_normal_distribution_is_scipys() -> None:
    x = np.linspace(-8.0, 8.0, 81)
    np.testing.assert_allclose(normal.density(x, 1.0, 2.0), stats.norm.pdf(x, 1.0, 2.0), rtol=1e-14)
    np.testing.assert_allclose(normal.cumulative(x, 1.0, 2.0), stats.norm.cdf(x, 1.0, 2.0), rtol=1e-13)
