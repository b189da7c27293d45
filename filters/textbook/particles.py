"""Figures 4.3 and 4.6: the standard example as particles, and how much chance is in them.

Particles are drawn from X and each is passed through the function; what comes out is distributed as Y, whatever the
function is (equations 4.22 and 4.23). Two robots with the same belief that do the same get different particles: the
density extracted from 25 of them differs from one draw to the next, that from 250 less.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from filters.density.kernel import Kernels
from filters.textbook import transform
from filters.textbook.error import root_mean_square
from filters.textbook.normal import Vector

COUNTS = (25, 250)
MANY = (25, 80, 250, 800, 2_500)
SPAN = (-1.0, 3.0)


@dataclass(frozen=True)
class Passing:
    """Figure 4.3.

    Attributes
    ----------
    x, y : (count,) float64
        Particles, and where the function takes them.
    mean, variance : float
        Of y.
    """

    x: Vector
    y: Vector
    mean: float
    variance: float


@dataclass(frozen=True)
class Draws:
    """Figure 4.6: several draws of one count.

    Attributes
    ----------
    count : int
    particles : (draws, count) float64
    y : (points,) float64
        Where the densities are given.
    densities : (draws, points) float64
        Kernel densities.
    """

    count: int
    particles: NDArray[np.float64]
    y: Vector
    densities: NDArray[np.float64]


@dataclass(frozen=True)
class Variability:
    """How much chance is in a draw, by the number of particles.

    Attributes
    ----------
    counts : (n,) int64
    mean_errors : (n,) float64
        Root mean square over the draws of the particles' mean less that of Y.
    theory : (n,) float64
        σ_Y/√M, what it should be.
    density_errors, density_spreads : (n,) float64
        Half the integral of |kernel density - exact|: its mean and its standard deviation over the draws.
    """

    counts: NDArray[np.int64]
    mean_errors: Vector
    theory: Vector
    density_errors: Vector
    density_spreads: Vector


def passing(count: int = 400, seed: int = 3) -> Passing:
    """Pass ``count`` particles of X through the function."""
    x, y = transform.sample(count, np.random.default_rng(seed))
    return Passing(x, y, float(y.mean()), float(y.var()))


def draws(count: int, repetitions: int = 3, seed: int = 11, points: int = 401) -> Draws:
    """Draw ``count`` particles several times over, and extract a kernel density of each draw."""
    generator = np.random.default_rng(seed)
    particles = np.array([transform.sample(count, generator)[1] for _ in range(repetitions)])
    y = np.linspace(*SPAN, points)
    densities = np.array([Kernels()(draw[:, None]).evaluate(y[:, None]) for draw in particles])
    return Draws(count, particles, y, densities)


def variability(repetitions: int = 100, counts: tuple[int, ...] = MANY) -> Variability:
    """Measure the chance in a draw over several counts."""
    mean, variance = transform.moments()
    rows = np.empty((len(counts), 3))
    for row, count in enumerate(counts):
        drawn = draws(count, repetitions, seed=count, points=161)
        step = float(drawn.y[1] - drawn.y[0])
        wrong = 0.5 * step * np.abs(drawn.densities - transform.density(drawn.y)).sum(axis=1)
        rows[row] = root_mean_square(drawn.particles.mean(axis=1) - mean), wrong.mean(), wrong.std()
    theory = math.sqrt(variance) / np.sqrt(np.array(counts, np.float64))
    return Variability(np.array(counts), rows[:, 0], theory, rows[:, 1], rows[:, 2])
