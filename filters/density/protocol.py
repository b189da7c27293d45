"""What every density is: density extraction (4.3.4), one question with several answers.

A particle set says where a belief was sampled; a density says it of every point. Each file beside this one
makes a density of a particle set in its own way, and all are asked the same three things: how dense is it
here, draw from it, what are its moments. Angles, where a dimension wraps, are radians in [-pi, pi).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class DensityMoments(NamedTuple):
    """First and second moments of a density.

    Attributes
    ----------
    mean : (d,) float64
        Of a dimension that wraps, the mean direction, in [-pi, pi).
    covariance : (d, d) float64
        Mean product of the differences from ``mean``; differences of angles are wrapped.
    """

    mean: Array
    covariance: Array


class Density(Protocol):
    """The named requirement of a density; its integral over all dimensions is one."""

    def evaluate(self, points: ArrayLike) -> Array:
        """Return the density at points, (count, d), in one over the product of the dimensions' units.

        Raises
        ------
        ValueError
            Points of another dimension, or not finite.
        """
        ...

    def draw(self, count: int, generator: np.random.Generator) -> Array:
        """Draw points, (count, d), independently."""
        ...

    def moments(self) -> DensityMoments:
        """Return mean and covariance of the density itself."""
        ...


class Extractor(Protocol):
    """What makes a density of a particle set."""

    def __call__(
        self, points: ArrayLike, weights: ArrayLike | None = None, circular: Sequence[bool] | None = None
    ) -> Density:
        """Extract a density.

        Parameters
        ----------
        points : (count, d) array
            The particles.
        weights : (count,) array, optional
            Not negative, up to a common factor; equal if not given.
        circular : sequence of d bool, optional
            Which dimensions are angles that wrap, radians; none if not given.

        Raises
        ------
        ValueError
            Shapes that do not fit, numbers that are not finite, negative weights, or weights that sum to zero.
        """
        ...
