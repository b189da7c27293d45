"""Angles: wrapped normals against quadrature and Fourier series, means against brute force."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate, optimize

from filters.density import circular as angles


@given(st.floats(-1e3, 1e3))
def test_a_wrapped_angle_is_the_same_direction(angle: float) -> None:
    wrapped = float(angles.wrap(np.array([angle]))[0])
    assert -math.pi <= wrapped < math.pi
    assert math.remainder(wrapped - angle, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-12)


def test_the_mean_is_that_of_the_cluster_alone() -> None:
    """Two headings either side of pi, weighed one to three: the direction that least squares of chords says."""
    points = np.array([[3.0], [-3.0]])
    weights = np.array([0.25, 0.75])
    found = optimize.minimize_scalar(
        lambda a: float(weights @ (1.0 - np.cos(points[:, 0] - a))), (3.0, 3.3), tol=1e-12
    ).x
    mean = angles.mean(points, weights, np.array([True]))
    assert mean[0] == pytest.approx(math.remainder(found, 2.0 * math.pi), abs=1e-6)


@pytest.mark.parametrize("offset", [0.0, 0.7, -2.5, math.pi])
@pytest.mark.parametrize("sigma", [0.01, 0.3, 0.8, 1.7, 4.0])
def test_wound_moments_are_those_of_the_integral(offset: float, sigma: float) -> None:
    def expected(power: int) -> float:
        total = 0.0
        first, last = (round((offset + side * 9.0 * sigma) / (2.0 * math.pi)) for side in (-1, 1))
        for turn in range(first, last + 1):
            low, high = (2 * turn - 1) * math.pi, (2 * turn + 1) * math.pi
            near = [p for p in np.linspace(offset - 9 * sigma, offset + 9 * sigma, 19) if low < p < high]
            total += integrate.quad(
                lambda y, turn=turn: (
                    (y - 2.0 * math.pi * turn) ** power * math.exp(-0.5 * ((y - offset) / sigma) ** 2)
                ),
                low,
                high,
                points=near or None,
                epsabs=1e-12,
            )[0]
        return total / (sigma * math.sqrt(2.0 * math.pi))

    found = angles.wound(offset, sigma)
    assert found.mean == pytest.approx(expected(1), abs=1e-9)
    assert found.square == pytest.approx(expected(2), abs=1e-9)
    draws = np.random.default_rng(1).normal(offset, sigma, 400_000)
    product = (draws - offset) * angles.wrap(draws)
    error = 4.9 * float(product.std()) / math.sqrt(product.size)  # false alarm 1e-6
    assert found.slope * sigma**2 == pytest.approx(float(product.mean()), abs=error)


def test_very_wide_normals_are_uniform() -> None:
    assert angles.wound(1.0, 9.0) == angles.Wound(0.0, math.pi**2 / 3.0, 0.0)
    assert angles.wound(1.0, 7.9).square == pytest.approx(math.pi**2 / 3.0, abs=1e-11)


@pytest.mark.parametrize("sigma", [0.1, 0.4, 0.9, 1.5, 2.5, 3.5])
def test_unwound_is_the_inverse(sigma: float) -> None:
    deviation = math.sqrt(angles.wound(0.0, sigma).square)
    assert angles.unwound(deviation) == pytest.approx(sigma, abs=1e-7 if sigma < 3.0 else 1e-4)


def test_what_is_wider_than_uniform_is_uniform() -> None:
    assert angles.unwound(2.0) == angles.UNIFORM
