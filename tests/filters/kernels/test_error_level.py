"""Sums over pairs: the NIS against a solver, and likelihoods in three dimensions against scipy's density."""

from __future__ import annotations

import numpy as np
from scipy.stats import multivariate_normal

from filters.kernels.error_level import log_likelihoods, normalised


def _spread(size: int, seed: int) -> np.ndarray:
    root = np.random.default_rng(seed).normal(size=(size, size))
    return root @ root.T


def test_nis_is_that_of_a_solver() -> None:
    for size in (1, 2, 3):
        residual, noise = np.arange(1.0, 1.0 + size), np.full(size, 0.3)
        spread = _spread(size, size)
        expected = residual @ np.linalg.solve(spread + np.diag(noise), residual)
        assert np.isclose(normalised(residual, spread, noise), expected, rtol=1e-12)


def test_rotations_find_the_axes_in_any_dimension() -> None:
    cautions, variances = np.array([1.0, 0.25]), np.array([4.0, 0.5])
    for size in (1, 2, 3, 4):
        residual, spread = np.linspace(-1.0, 2.0, size), _spread(size, 10 + size)
        logs = np.empty(2)
        log_likelihoods(cautions, variances, 0.2, residual, spread, 1.0, logs)
        expected = [
            multivariate_normal(np.zeros(size), k * spread + (0.2 + v) * np.eye(size)).logpdf(residual)
            + 0.5 * size * np.log(2.0 * np.pi)
            for k, v in zip(cautions, variances, strict=True)
        ]
        np.testing.assert_allclose(logs, expected, rtol=1e-9)
