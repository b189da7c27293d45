"""The binned kernel density against the exact sum."""

from __future__ import annotations

import math

import numpy as np
import pytest

from filters.density.binned import BinnedKernelDensity, BinnedKernels
from filters.density.kernel import Kernels
from filters.density.weighted import weighted


@pytest.mark.parametrize("circular", [(False,), (True,), (False, True), (False, False, True)])
def test_it_equals_the_exact_sum(circular: tuple[bool, ...]) -> None:
    """To 2e-3 of the highest density at four nodes a bandwidth, in the middle as at the turn."""
    rng = np.random.default_rng(1)
    points = rng.normal(size=(800, len(circular)))
    points[400:] += 2.5
    weights = rng.random(800)
    exact = Kernels()(points, weights, circular)
    x = exact.draw(200, rng)
    expected = exact.evaluate(x)
    found = BinnedKernels()(points, weights, circular).evaluate(x)
    np.testing.assert_allclose(found, expected, atol=2e-3 * float(expected.max()))


def test_finer_is_more_exact() -> None:
    """Twice as fine, at least three times as exact, twice."""
    points = np.random.default_rng(2).normal(size=(300, 1))
    exact = Kernels(bandwidth=[0.3])(points)
    x = np.linspace(-3.0, 3.0, 2001)[:, None]
    errors = [
        float(
            np.sqrt(
                np.mean(np.square(BinnedKernels([0.3], fineness=f)(points).evaluate(x) - exact.evaluate(x)))
            )
        )
        for f in (4.0, 8.0, 16.0)
    ]
    assert errors[0] / errors[1] > 3.0
    assert errors[1] / errors[2] > 3.0


def test_its_moments_are_those_of_the_exact_density() -> None:
    rng = np.random.default_rng(3)
    points, weights = rng.normal(size=(500, 2)) * [3.0, 0.5], rng.random(500)
    mean, covariance = BinnedKernels()(points, weights).moments()
    expected = Kernels()(points, weights).moments()
    np.testing.assert_allclose(mean, expected.mean, atol=1e-7)
    np.testing.assert_allclose(covariance, expected.covariance, rtol=3e-4, atol=1e-3)


def test_beyond_the_grid_there_is_nothing() -> None:
    density = BinnedKernels([0.1])([[0.0], [1.0]])
    assert density.evaluate([[-5.0], [50.0]]).tolist() == [0.0, 0.0]


def test_a_grid_too_large_or_too_coarse_is_refused() -> None:
    with pytest.raises(ValueError, match="fineness"):
        BinnedKernels([0.1], fineness=1.0)([[0.0], [1.0]])
    with pytest.raises(ValueError, match="nodes"):
        BinnedKernels([1e-9])([[0.0], [1.0]])


def test_a_wide_kernel_on_the_circle_is_uniform() -> None:
    density = BinnedKernelDensity(weighted("test", [[1.0]], None, [True]), np.array([6.0]))
    np.testing.assert_allclose(density.evaluate([[0.0], [3.0]]), 1.0 / (2.0 * math.pi), rtol=1e-6)
