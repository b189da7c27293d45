"""A belief as a mixture of Gaussians: several hypotheses, each with a weight, a mean and its own covariance.

What makes one of a particle set is :class:`filters.density.k_means.KMeans`. The moments are those of the whole
mixture, by the law of total covariance: the mean of one component beside the covariance of all would be
neither.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from filters.density import circular as angles
from filters.density.normal import Gaussian
from filters.density.protocol import Array, DensityMoments


class Mixture:
    """Σ wₖ N(μₖ, Cₖ), components in the order given.

    Parameters
    ----------
    weights : (k,) array
        Not negative, up to a common factor.
    components : sequence of k Gaussian
        All of the same dimensions, the same of them circular.
    left_out : float
        Share of the particles' weight that no component stands for; said, not used.

    Attributes
    ----------
    weights : (k,) float64
        They sum to one.

    Raises
    ------
    ValueError
        No component, components that differ in their dimensions, or weights that are none.
    """

    def __init__(self, weights: ArrayLike, components: Sequence[Gaussian], left_out: float = 0.0) -> None:
        share = np.array(weights, np.float64, ndmin=1)
        if not components or share.shape != (len(components),):
            raise ValueError(
                f"mixture: a weight for each component, at least one, is needed, got {share.shape} weights and "
                f"{len(components)} components"
            )
        if not (share >= 0.0).all() or not 0.0 < float(share.sum()) < np.inf:
            raise ValueError(
                f"mixture: weights must be finite, not negative, with a positive sum, got {share.tolist()}"
            )
        self.circular = components[0].circular
        if any(not np.array_equal(each.circular, self.circular) for each in components):
            raise ValueError(
                "mixture: every component must have the same dimensions, the same of them circular"
            )
        self.weights: Array = share / share.sum()
        self.components = tuple(components)
        self.left_out = left_out

    @property
    def means(self) -> Array:
        """Means of the components, (k, d)."""
        return np.array([each.mean for each in self.components])

    @property
    def covariances(self) -> Array:
        """Covariances of the components, (k, d, d), each about its own mean."""
        return np.array([each.covariance for each in self.components])

    def evaluate(self, points: ArrayLike) -> Array:
        """Return the density at points; see :class:`filters.density.protocol.Density`."""
        heights = [each.evaluate(points) for each in self.components]
        return np.einsum("k,kn->n", self.weights, np.array(heights))

    def draw(self, count: int, generator: np.random.Generator) -> Array:
        """Draw points; see :class:`filters.density.protocol.Density`."""
        chosen = generator.choice(len(self.weights), count, p=self.weights)
        points = np.empty((count, self.circular.size))
        for k, each in enumerate(self.components):
            mine = np.flatnonzero(chosen == k)
            points[mine] = each.draw(mine.size, generator)
        return points

    def moments(self) -> DensityMoments:
        """Return mean and covariance of the whole: C = Σ wₖ (Cₖ + (μₖ - μ)(μₖ - μ)ᵀ), with angles wound."""
        means = self.means
        centre = self.weights @ means
        length = np.array([each.resultant() for each in self.components])
        across = self.weights @ (length * np.sin(means))
        along = self.weights @ (length * np.cos(means))
        centre[self.circular] = angles.wrap(np.arctan2(across, along))[self.circular]
        second = [each.second_moment_about(centre) for each in self.components]
        return DensityMoments(centre, np.einsum("k,kij->ij", self.weights, np.array(second)))
