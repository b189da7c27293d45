"""Cells as means and as integrals, against scipy's quadrature and normal distribution."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from scipy import integrate, stats

from filters.cells import CellIntegral, CellMean, Nodes, log_mean

DISTANCES = np.arange(-6, 7)[None, :] * 0.5 + np.array([[0.0], [0.2], [-0.13]])


@pytest.mark.interpreted
def test_shares_by_the_mean_state_are_densities_normalised() -> None:
    density = stats.norm.pdf(DISTANCES, scale=0.4)
    np.testing.assert_allclose(
        CellMean().shares(DISTANCES, 0.5, 0.4), density / density.sum(axis=1, keepdims=True), rtol=1e-12
    )


@pytest.mark.interpreted
def test_shares_by_integral_are_probabilities() -> None:
    exact = stats.norm.cdf(DISTANCES + 0.25, scale=0.4) - stats.norm.cdf(DISTANCES - 0.25, scale=0.4)
    np.testing.assert_allclose(CellIntegral(2).shares(DISTANCES, 0.5, 0.4), exact, atol=1e-12)


def test_shares_far_out_keep_their_digits() -> None:
    exact = stats.norm.sf(5.0) - stats.norm.sf(6.0)
    share = CellIntegral(1).shares(np.array([[-5.5, 0.0, 5.5]]), 1.0, 1.0)
    middle = stats.norm.cdf(0.5) - stats.norm.cdf(-0.5)
    np.testing.assert_allclose(share[0, [0, 2]] / share[0, 1], exact / middle, rtol=1e-9)


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_nodes_integrate_polynomials_exactly(dimension: int) -> None:
    """Order 3 is exact up to degree 5: the mean of x⁴ over a unit interval about 0 is 1/80."""
    nodes = CellIntegral(3).nodes(dimension)
    assert nodes.weights.sum() == pytest.approx(1.0, abs=1e-14)
    assert nodes.weights @ np.prod(nodes.offsets**4, axis=1) == pytest.approx(80.0**-dimension, abs=1e-15)


def likelihood(x: float, y: float) -> float:
    return -0.5 * ((math.hypot(x - 1.0, y + 2.0) - 3.0) / 0.7) ** 2


def vectorised(states: Sequence[np.ndarray]) -> np.ndarray:
    return -0.5 * ((np.hypot(states[0] - 1.0, states[1] + 2.0) - 3.0) / 0.7) ** 2


def test_the_mean_likelihood_of_a_cell_equals_its_integral() -> None:
    """Equation 4.6 to 1e-10; equation 4.7 is the value at the mean state."""
    centres, width = [np.array([[0.3], [2.0]]), np.array([[0.1, 1.0]])], np.array([0.8, 0.6])
    exact = [
        [
            integrate.dblquad(
                lambda y, x: math.exp(likelihood(x, y)), a - 0.4, a + 0.4, b - 0.3, b + 0.3, epsabs=1e-13
            )[0]
            / width.prod()
            for b in (0.1, 1.0)
        ]
        for a in (0.3, 2.0)
    ]
    integral = np.exp(log_mean(vectorised, centres, width, CellIntegral(12).nodes(2)))
    np.testing.assert_allclose(integral, exact, atol=1e-10)
    mean = log_mean(vectorised, centres, width, CellMean().nodes(2))
    np.testing.assert_allclose(mean, vectorised(centres))
    assert np.abs(np.exp(mean) - integral).max() > 1e-2


@pytest.mark.parametrize("order", [0, 33])
def test_an_order_out_of_range_is_refused(order: int) -> None:
    with pytest.raises(ValueError, match="order"):
        CellIntegral(order)


@pytest.mark.parametrize("given", [math.nan, math.inf, np.zeros(3), np.zeros((2, 1, 1))])
def test_logs_that_make_no_sense_are_refused(given: object) -> None:
    with pytest.raises(ValueError, match="log likelihood"):
        log_mean(lambda _: given, [np.zeros((2, 1)), np.zeros((1, 2))], np.ones(2), CellMean().nodes(2))


def test_a_rule_without_nodes_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one node"):
        log_mean(vectorised, [np.zeros(2)], np.ones(1), Nodes(np.zeros((0, 1)), np.zeros(0)))
