"""A density tree of a particle set (4.3.4): boxes halved as long as they hold more than a share of the weight.

The tree itself is :class:`filters.density_tree.DensityTree`; here it is chosen how far to divide, and about what.
Fewer cells than a histogram, fine where the particles are, and found in logarithmic time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from filters.density.histogram import scott_widths
from filters.density.weighted import Weighted, weighted
from filters.density_tree import DensityTree
from filters.tree_nodes import Side

FINER = 8.0
"""How much narrower than a histogram's cell a leaf may become."""


class Trees:
    """The :class:`~filters.density.protocol.Extractor` of a density tree.

    Parameters
    ----------
    bound : float, optional
        Boxes with a larger share of the weight are split, in (0, 1). If not given, n^(-d/(d + 2)) for an
        effective sample size n: as many leaves as a histogram by Scott's rule has cells per deviation.
    sides : sequence of Side, optional
        The box that is divided, and how finely; the box about the particles if not given.
    """

    def __init__(self, bound: float | None = None, sides: Sequence[Side] | None = None) -> None:
        self._bound = bound
        self._sides = sides

    def __call__(
        self, points: ArrayLike, weights: ArrayLike | None = None, circular: Sequence[bool] | None = None
    ) -> DensityTree:
        """Extract a density tree.

        Raises
        ------
        ValueError
            As the protocol says; sides that do not fit or hold no weight, a bound outside (0, 1).
        """
        particles = weighted("density tree extraction", points, weights, circular)
        size = particles.points.shape[1]
        sides = sides_about(particles) if self._sides is None else self._sides
        if tuple(side.wraps for side in sides) != tuple(bool(flag) for flag in particles.circular):
            raise ValueError(
                f"density tree extraction: the sides wrap along {[side.wraps for side in sides]}, the particles "
                f"along {particles.circular.tolist()}"
            )
        bound = self._bound
        if bound is None:
            bound = min(particles.effective_sample_size ** (-size / (size + 2)), 0.5)
        return DensityTree.of_particles(sides, particles.points, bound, particles.weights)


def sides_about(particles: Weighted) -> list[Side]:
    """Return the sides of the smallest box about all particles; whole circles for angles."""
    low, high = particles.points.min(axis=0), particles.points.max(axis=0)
    low, high = low - 1e-9 * (1.0 + np.abs(low)), high + 1e-9 * (1.0 + np.abs(high))
    finest = scott_widths(particles) / FINER
    finest = np.where(finest > 0.0, finest, high - low)
    return [
        Side(-math.pi, math.pi, float(fine), wraps=True) if wraps else Side(float(a), float(b), float(fine))
        for a, b, fine, wraps in zip(low, high, finest, particles.circular, strict=True)
    ]
