"""What is normal for a source: against scipy's densities, and what it learns from residuals of known size."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from filters.error_level import CAUTIONS, LEVELS, ErrorLevel, Opinion

SPREAD = np.array([[9.0, 2.0], [2.0, 4.0]])
NOISE = np.array([0.5, 0.5])


def _opinion(level: ErrorLevel, residual: np.ndarray, spread: np.ndarray, noise: np.ndarray) -> Opinion:
    """Return what a Gaussian of that spread makes of a residual, as the second of two, which are measured directly."""
    size = residual.size
    expected = np.stack([0 * residual, residual]), np.stack([np.eye(size)] * 2), np.stack([noise, noise])
    return level.hear_out(expected, np.stack([np.eye(size), spread]), 1, 2.0)


def _densities(residual: np.ndarray, usual: float, floor: bool) -> np.ndarray:
    size = residual.size
    return np.array(
        [
            multivariate_normal(
                np.zeros(size),
                caution * SPREAD[:size, :size]
                + (NOISE[0] + (usual if floor else usual * level) ** 2) * np.eye(size),
            ).pdf(residual)
            for caution, level in product(CAUTIONS, LEVELS)
        ]
    )


@pytest.mark.parametrize("residual", [np.array([3.0, -7.0]), np.array([12.0])])
def test_surprise_is_the_ratio_of_two_mixtures(residual: np.ndarray) -> None:
    size = residual.size
    level = ErrorLevel(2.0)
    expected = math.log(_densities(np.zeros(size), 2.0, True).mean() / _densities(residual, 2.0, True).mean())
    spread, noise = np.ascontiguousarray(SPREAD[:size, :size]), NOISE[:size]
    found = _opinion(level, residual, spread, 2.0 * noise)
    assert found.surprise == pytest.approx(expected, rel=1e-12)
    assert found.nis == pytest.approx(
        residual @ np.linalg.solve(spread + np.diag(noise), residual), rel=1e-12
    )
    np.testing.assert_array_equal(found.testimony.residual, residual)
    np.testing.assert_allclose(found.testimony.spread, spread, rtol=1e-12)
    np.testing.assert_array_equal(found.testimony.noise, noise)


def test_learns_by_bayes_rule_tempered_by_the_weight() -> None:
    level = ErrorLevel(2.0, forgetting=0.0)
    residuals = np.random.default_rng(1).normal(size=(5, 2))
    weights = np.ones(9) / 9
    for residual in residuals:
        level.learn(residual, SPREAD, NOISE, 0.5)
        weights *= _densities(residual, 2.0, False) ** 0.5
    weights /= weights.sum()
    cautions = np.array([caution for caution, _ in product(CAUTIONS, LEVELS)])
    assert level.caution == pytest.approx(float(weights @ cautions), rel=1e-9)


@pytest.mark.parametrize("caution", CAUTIONS)
def test_finds_out_how_cautious_a_prediction_is(caution: float) -> None:
    """Of 200 residuals with k times the covariance it is off by less than 0.15 in k; a false alarm in 1e4 seeds."""
    chance = np.random.default_rng(7)
    level = ErrorLevel(0.1, forgetting=0.0)
    for residual in chance.multivariate_normal(np.zeros(2), caution * SPREAD, 200):
        level.learn(residual, SPREAD, np.zeros(2), 1.0)
    assert level.caution == pytest.approx(caution, abs=0.15)


def test_a_source_that_was_quiet_is_still_granted_the_usual_level() -> None:
    level = ErrorLevel(5.0)
    for _ in range(500):
        level.learn(np.zeros(2), 0.01 * np.eye(2), NOISE, 1.0)
    assert _opinion(level, np.array([10.0, 0.0]), 0.01 * np.eye(2), 2.0 * NOISE).surprise < 2.1
    assert _opinion(level, np.array([25.0, 0.0]), 0.01 * np.eye(2), 2.0 * NOISE).surprise > 12.0


def test_a_claimed_noise_leaves_less_evidence() -> None:
    def left(noise: float) -> float:
        return _opinion(ErrorLevel(5.0), np.ones(2), np.eye(2), np.full(2, 2.0 * noise)).information(8.0)

    assert left(0.0) == 8.0
    assert left(75.0) == pytest.approx(8.0 - math.log(4.0))
    assert left(1e9) == 0.0


def test_refuses_what_makes_no_sense() -> None:
    with pytest.raises(ValueError, match="usual must be positive"):
        ErrorLevel(0.0)
    with pytest.raises(ValueError, match="forgetting"):
        ErrorLevel(1.0, 2.0)
    with pytest.raises(ValueError, match="finite"):
        ErrorLevel(1.0).learn(np.array([math.nan]), np.eye(1), np.ones(1), 1.0)
