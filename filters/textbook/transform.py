"""The chapter's standard example: a Gaussian X passed through a nonlinear function g, with Y = g(X) known exactly.

Figures 4.1, 4.3, 4.5 and 4.6 all show this one example. The book draws its function and does not name it; here

    g(x) = x + a sin(k (x - μ) + φ)

It climbs everywhere, so Y has its density in closed form, p(y) = p(x) / g'(x) at x = g⁻¹(y). It climbs steeply at the
middle of X and slowly on both sides of it, so Y has a long middle and two humps, one higher than the other: no Gaussian
is like it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from filters.textbook import normal
from filters.textbook.normal import Vector

MEAN = 1.0
"""Mean μ of X."""
SIGMA = 0.5
"""Standard deviation σ of X."""
WAVES = 3.5
"""k, one over the unit of x."""
AMPLITUDE = 0.6 / WAVES
"""a, so that g' lies in 0.4 to 1.6."""
PHASE = 0.5
"""φ, which makes the humps unequal."""
_HALVINGS = 7
_NEWTON = 4


def function(x: ArrayLike) -> Vector:
    """Return g(x)."""
    x = np.asarray(x, np.float64)
    return x + AMPLITUDE * np.sin(WAVES * (x - MEAN) + PHASE)


def slope(x: ArrayLike) -> Vector:
    """Return g'(x), everywhere positive."""
    return 1.0 + AMPLITUDE * WAVES * np.cos(WAVES * (np.asarray(x, np.float64) - MEAN) + PHASE)


def inverse(y: ArrayLike) -> Vector:
    """Return g⁻¹(y): the interval that must hold it, for g(x) - x lies within ± a, is halved; then Newton's steps."""
    y = np.asarray(y, np.float64)
    low, high = y - AMPLITUDE, y + AMPLITUDE
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        below = function(middle) < y
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    x = 0.5 * (low + high)
    for _ in range(_NEWTON):
        x = x - (function(x) - y) / slope(x)
    return x


def density(y: ArrayLike) -> Vector:
    """Exact density of Y."""
    x = inverse(y)
    return normal.density(x, MEAN, SIGMA) / slope(x)


def cumulative(y: ArrayLike) -> Vector:
    """Exact probability of Y up to y."""
    return normal.cumulative(inverse(y), MEAN, SIGMA)


def moments() -> tuple[float, float]:
    """Exact mean and variance of Y.

    With s = sin(k (X - μ) + φ): E[s] = e^(-k²σ²/2) sin φ, Var[s] from E[s²], and Cov[X, s] = σ² k e^(-k²σ²/2) cos φ by
    Stein's lemma.
    """
    damping = math.exp(-0.5 * (WAVES * SIGMA) ** 2)
    mean = damping * math.sin(PHASE)
    variance = 0.5 * (1.0 - damping**4 * math.cos(2.0 * PHASE)) - mean**2
    covariance = SIGMA**2 * WAVES * damping * math.cos(PHASE)
    return MEAN + AMPLITUDE * mean, SIGMA**2 + 2.0 * AMPLITUDE * covariance + AMPLITUDE**2 * variance


def sample(count: int, generator: np.random.Generator) -> tuple[Vector, Vector]:
    """Draw x from X, and pass it through the function.

    Returns
    -------
    x, y : (count,) float64
    """
    x = generator.normal(MEAN, SIGMA, count)
    return x, function(x)
