"""Figure 4.4: importance factors. Samples of one density, weighted, stand for another.

The probability that a target density f gives to an interval A is an expectation under a proposal density g as well
(equation 4.25); samples of g with the weights

    w = f(x) / g(x)                                                       (4.27)
    [Σ w]⁻¹ Σ I(x ∈ A) w  →  ∫_A f(x) dx                                  (4.28)

converge to it, with an error of order 1/√M. The factor before it says how alike f and g are; by the delta method it is
the square root of ∫ f²/g (I - p)² dx. Without weights they converge to the integral of g (4.26). Resampled by their
weights, they are samples of f: lines 8 to 11 of Table 4.3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from filters.resampling import systematic
from filters.textbook import normal
from filters.textbook.error import root_mean_square
from filters.textbook.normal import Vector

HUMPS = ((0.6, 3.0, 0.7), (0.4, 6.0, 0.5))
"""The target f: weight, mean and standard deviation of its two Gaussians."""
PROPOSALS = {"broad": (4.0, 2.0), "shifted": (2.5, 1.5)}
"""Proposals g: mean and standard deviation of one Gaussian each; the first is drawn in the figure."""
INTERVAL = (5.0, 7.0)
"""A."""
COUNTS = (30, 100, 300, 1_000, 3_000, 10_000)


@dataclass(frozen=True)
class Illustration:
    """What the three panels of the figure show.

    Attributes
    ----------
    samples : (count,) float64
        Of g.
    weights : (count,) float64
        w of equation 4.27, not normalised.
    resampled : (count,) float64
        Drawn from the samples by Table 4.4: samples of f.
    effective_sample_size : float
    """

    samples: Vector
    weights: Vector
    resampled: Vector
    effective_sample_size: float


@dataclass(frozen=True)
class Error:
    """How wrong the probability of the interval is, by the number of samples.

    Attributes
    ----------
    proposal : str
    counts : (n,) int64
    errors : (n,) float64
        Root mean square over the repetitions, of the weighted share against the integral of f (4.28).
    theory : (n,) float64
        The delta method's.
    unweighted : (n,) float64
        The same of the share without weights, against the integral of f: it does not go away.
    """

    proposal: str
    counts: NDArray[np.int64]
    errors: Vector
    theory: Vector
    unweighted: Vector


def target(x: ArrayLike) -> Vector:
    """Density f."""
    return np.sum([share * normal.density(x, mean, sigma) for share, mean, sigma in HUMPS], axis=0)


def proposal(x: ArrayLike, name: str = "broad") -> Vector:
    """Density g."""
    return normal.density(x, *PROPOSALS[name])


def probability() -> float:
    """Return the integral of f over the interval."""
    low, high = (
        sum(share * float(normal.cumulative(end, mean, sigma)) for share, mean, sigma in HUMPS)
        for end in INTERVAL
    )
    return high - low


def illustrate(count: int = 60, seed: int = 4) -> Illustration:
    """Draw from g, weigh, resample."""
    generator = np.random.default_rng(seed)
    samples = generator.normal(*PROPOSALS["broad"], count)
    weights = target(samples) / proposal(samples)
    uniform = 1.0 - generator.random()
    ancestors = systematic(weights.astype(np.float32), count, uniform)
    return Illustration(samples, weights, samples[ancestors], float(weights.sum() ** 2 / np.sum(weights**2)))


def error(name: str, repetitions: int = 400, counts: tuple[int, ...] = COUNTS, seed: int = 1) -> Error:
    """Measure the error of equation 4.28 with one of the proposals."""
    generator = np.random.default_rng(seed)
    truth = probability()
    factor = _factor(name)
    measured, plain = np.empty(len(counts)), np.empty(len(counts))
    for row, count in enumerate(counts):
        samples = generator.normal(*PROPOSALS[name], (repetitions, count))
        weights = target(samples) / proposal(samples, name)
        inside = (samples > INTERVAL[0]) & (samples < INTERVAL[1])
        shares = np.sum(weights * inside, axis=1) / np.sum(weights, axis=1)
        measured[row] = root_mean_square(shares - truth)
        plain[row] = root_mean_square(inside.mean(axis=1) - truth)
    return Error(name, np.array(counts), measured, factor / np.sqrt(np.array(counts)), plain)


def _factor(name: str) -> float:
    """Square root of ∫ f²/g (I - p)² dx, by the mid-point rule."""
    step = 1e-3
    x = np.arange(-4.0, 12.0, step) + 0.5 * step
    inside = (x > INTERVAL[0]) & (x < INTERVAL[1])
    return math.sqrt(float(np.sum(target(x) ** 2 / proposal(x, name) * (inside - probability()) ** 2)) * step)
