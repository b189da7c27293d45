"""Figure 4.5: one set of particles, and the densities that can be extracted from it (4.3.4).

The particles are the chapter's standard example, a Gaussian passed through a nonlinear function, whose density is
known: every way of extraction is drawn against it. To the book's three (Gaussian, histogram, kernels) come the
two that its text describes: the k-means mixture and the density tree.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from filters.density.histogram import Histograms
from filters.density.k_means import KMeans
from filters.density.kernel import Kernels
from filters.density.normal import gaussian
from filters.density.protocol import Density
from filters.density.tree import Trees
from filters.textbook import transform
from filters.textbook.normal import Vector


@dataclass(frozen=True)
class Extraction:
    """The figure's curves.

    Attributes
    ----------
    particles : (count,) float64
        States y, equally weighted.
    y : (points,) float64
        Where the densities are given, evenly spaced.
    exact : (points,) float64
        True density of Y.
    exact_gaussian : (points,) float64
        The Gaussian of the true mean and variance of Y: the solid line of panel (b).
    densities : dict of str to (points,) float64
        ``gaussian``, ``mixture``, ``histogram``, ``tree`` and ``kernel``, each extracted from the particles.
    error : dict of str to float
        Half the integral of |extracted - exact|: the probability that is in the wrong place.
    numbers : dict of str to int
        How many numbers each density keeps: parameters, cells, leaves, or the particles.
    """

    particles: Vector
    y: Vector
    exact: Vector
    exact_gaussian: Vector
    densities: dict[str, Vector]
    error: dict[str, float]
    numbers: dict[str, int]


def extraction(count: int = 500, points: int = 1201, seed: int = 4) -> Extraction:
    """Extract five densities from ``count`` particles of the standard example.

    Raises
    ------
    ValueError
        Fewer than ten particles or two points.
    """
    if count < 10 or points < 2:
        raise ValueError(
            f"extraction: at least 10 particles and 2 points are needed, got {count} and {points}"
        )
    particles = transform.sample(count, np.random.default_rng(seed))[1]
    given = particles[:, None]
    one, mixture, histogram = gaussian(given), KMeans()(given), Histograms()(given)
    tree, kernel = Trees()(given), Kernels()(given)
    densities: dict[str, Density] = {
        "gaussian": one,
        "mixture": mixture,
        "histogram": histogram,
        "tree": tree,
        "kernel": kernel,
    }
    mean, variance = transform.moments()
    y: Vector = mean + variance**0.5 * np.linspace(-4.0, 4.0, points, dtype=np.float64)
    exact = transform.density(y)
    curves = {name: density.evaluate(y[:, None]) for name, density in densities.items()}
    step = float(y[1] - y[0])
    return Extraction(
        particles,
        y,
        exact,
        transform.normal.density(y, mean, variance**0.5),
        curves,
        {name: 0.5 * step * float(np.abs(curve - exact).sum()) for name, curve in curves.items()},
        {
            "gaussian": 2,
            "mixture": 3 * len(mixture.weights) - 1,
            "histogram": histogram.grid.size,
            "tree": tree.leaf_count,
            "kernel": count,
        },
    )
