"""A mixture's density and regions, beside scipy, a closed form and draws of its own."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from service.mixture import Mixture

TWO = Mixture(
    np.array([0.7, 0.3]),
    np.array([[0.0, 0.0], [30.0, -4.0]]),
    np.array([[4.0, 1.2, 0.5], [1.0, 0.0, 9.0]]),
)


def matrix(row: np.ndarray) -> np.ndarray:
    return np.array([[row[0], row[1]], [row[1], row[2]]])


def test_the_density_is_scipys() -> None:
    points = np.random.default_rng(1).normal(0.0, 20.0, (50, 2))
    parts = [
        weight * stats.multivariate_normal(mean, matrix(covariance)).pdf(points)
        for weight, mean, covariance in zip(TWO.weights, TWO.means, TWO.covariances, strict=True)
    ]
    found = TWO.log_density(points)
    near = np.sum(parts, axis=0) > 1e-280
    assert found[near] == pytest.approx(np.log(np.sum(parts, axis=0)[near]), rel=1e-9)
    assert np.isfinite(TWO.log_density(np.array([[1e5, 1e5]]))).all(), (
        "far away it is small, not minus infinity"
    )


@pytest.mark.parametrize("place", [(0.0, 0.0), (0.5, 0.1), (2.0, 0.3), (4.0, 2.0)])
def test_one_gaussians_level_is_the_closed_form(place: tuple[float, float]) -> None:
    """1 - exp(-d² / 2); 256 points give it to a hundredth."""
    one = Mixture(np.ones(1), np.zeros((1, 2)), np.array([[4.0, 1.2, 0.5]]))
    square = np.array(place) @ np.linalg.solve(matrix(one.covariances[0]), np.array(place))
    assert one.level(*place) == pytest.approx(1.0 - math.exp(-0.5 * square), abs=0.01)


def test_levels_of_draws_from_the_mixture_are_uniform() -> None:
    """1,500 draws, Kolmogorov and Smirnov; the lattice blurs by a hundredth. False alarm below 1e-3."""
    random = np.random.default_rng(2)
    levels = []
    for component in random.choice(2, 1500, p=TWO.weights):
        north, east = random.multivariate_normal(TWO.means[component], matrix(TWO.covariances[component]))
        levels.append(TWO.level(north, east))
    assert stats.kstest(levels, "uniform").statistic < 1.95 / math.sqrt(1500) + 0.01


def test_a_place_between_two_hypotheses_is_in_no_small_region() -> None:
    assert TWO.level(15.0, -2.0) > 0.99
    assert TWO.level(30.0, -4.0) < 0.95


def test_a_variance_of_none_and_a_rounded_covariance_have_a_density() -> None:
    thin = Mixture(np.ones(1), np.zeros((1, 2)), np.array([[0.0, 0.0, 0.0]]))
    assert math.isfinite(thin.log_density(np.zeros((1, 2)))[0])
    over = Mixture(np.ones(1), np.zeros((1, 2)), np.array([[1.0, 1.001, 1.0]]))
    assert 0.0 <= over.level(3.0, 3.0) <= 1.0
