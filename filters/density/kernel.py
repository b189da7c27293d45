"""Kernel density of a particle set, figure 4.5 (d): a Gaussian about every particle.

    p(x) = Σ wᵢ Πⱼ N(xⱼ; xᵢⱼ, hⱼ²)

with the kernel wound on the circle in the dimensions that wrap. Smooth, and simple; a look-up costs as many steps
as there are particles. Where there are many particles and at most three dimensions, :mod:`filters.density.binned`
says the same in a time that does not depend on them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from filters.density import circular as angles
from filters.density.protocol import Array, DensityMoments
from filters.density.weighted import Weighted, asked, weighted

Rule = Callable[[float, int], float]
"""From the effective sample size and the dimension to the bandwidth over the deviation."""

PAIRS = 1 << 21
"""Pairs of point and particle that are worked on at once."""


def silverman(effective: float, dimension: int) -> float:
    """Silverman's rule, (4 / ((d + 2) n))^(1/(d + 4)): least error if the belief is one Gaussian.

    Silverman, *Density Estimation for Statistics and Data Analysis*, 1986, eq. 4.14. Of several modes it makes
    too wide ones: give the bandwidth, or extract a mixture.
    """
    return (4.0 / ((dimension + 2) * effective)) ** (1.0 / (dimension + 4))


def scott(effective: float, dimension: int) -> float:
    """Scott's rule, n^(-1/(d + 4))."""
    return effective ** (-1.0 / (dimension + 4))


class KernelDensity:
    """The exact sum over all particles.

    Parameters
    ----------
    particles : Weighted
    bandwidth : (d,) array
        Standard deviation of the kernel in each dimension.

    Raises
    ------
    ValueError
        Bandwidths that are not positive and finite, or not d of them.
    """

    def __init__(self, particles: Weighted, bandwidth: ArrayLike) -> None:
        self.particles = particles
        self.bandwidth = _checked(bandwidth, particles.points.shape[1])

    def evaluate(self, points: ArrayLike) -> Array:
        """Return the density at points; see :class:`filters.density.protocol.Density`."""
        given = asked("kernel density", points, self.bandwidth.size)
        step = max(PAIRS // len(self.particles.weights), 1)
        parts = [self._sum(given[first : first + step]) for first in range(0, len(given), step)]
        return np.concatenate(parts) if parts else np.zeros(0)

    def draw(self, count: int, generator: np.random.Generator) -> Array:
        """Draw points: a particle by its weight, then from its kernel."""
        chosen = generator.choice(len(self.particles.weights), count, p=self.particles.weights)
        noise = generator.standard_normal((count, self.bandwidth.size)) * self.bandwidth
        return angles.wrap_columns(self.particles.points[chosen] + noise, self.particles.circular)

    def moments(self) -> DensityMoments:
        """Return mean and covariance: those of the particles, and the kernel's variance added.

        Of an angle this counts what the kernel carries across the far side of the circle as if it went on: too
        much by less than the kernel's variance.
        """
        mean, covariance = self.particles.moments()
        return DensityMoments(mean, covariance + np.diag(self.bandwidth**2))

    def _sum(self, points: Array) -> Array:
        square = np.zeros((len(points), len(self.particles.weights)))
        product: Array | None = None
        for j, width in enumerate(self.bandwidth):
            away = points[:, j, None] - self.particles.points[None, :, j]
            if not self.particles.circular[j]:
                square += np.square(away / width)
                continue
            away = angles.wrap(away)
            last = int(angles.REACH * width / angles.TURN + 0.5)
            turned = sum(
                (np.exp(-0.5 * np.square((away + k * angles.TURN) / width)) for k in range(-last, last + 1)),
                np.zeros_like(away),
            )
            product = turned if product is None else product * turned
        heights = np.exp(-0.5 * square)
        if product is not None:
            heights *= product
        scale = float(np.prod(self.bandwidth)) * (2.0 * math.pi) ** (0.5 * self.bandwidth.size)
        return heights @ self.particles.weights / scale


class Kernels:
    """The :class:`~filters.density.protocol.Extractor` of an exact kernel density.

    Parameters
    ----------
    bandwidth : (d,) array, optional
        By the rule if not given.
    rule : callable
        :func:`silverman` or :func:`scott`.
    """

    def __init__(self, bandwidth: ArrayLike | None = None, rule: Rule = silverman) -> None:
        self._bandwidth = bandwidth
        self._rule = rule

    def __call__(
        self, points: ArrayLike, weights: ArrayLike | None = None, circular: Sequence[bool] | None = None
    ) -> KernelDensity:
        """Extract a kernel density.

        Raises
        ------
        ValueError
            As the protocol says; bandwidths that are none, or a dimension without spread for the rule.
        """
        particles = weighted("kernel density extraction", points, weights, circular)
        return KernelDensity(particles, chosen_bandwidth(particles, self._bandwidth, self._rule))


def chosen_bandwidth(particles: Weighted, bandwidth: ArrayLike | None, rule: Rule) -> Array:
    """Return the bandwidth given, (d,), or by the rule: its factor times each dimension's deviation.

    Raises
    ------
    ValueError
        Bandwidths that are not positive and finite, or by the rule a dimension without spread.
    """
    size = particles.points.shape[1]
    if bandwidth is not None:
        return _checked(bandwidth, size)
    deviation = np.sqrt(np.diag(particles.moments().covariance))
    if not (deviation > 0.0).all():
        raise ValueError(
            f"kernel density: dimension {int(deviation.argmin())} has no spread for a rule; give a bandwidth"
        )
    return deviation * rule(particles.effective_sample_size, size)


def _checked(bandwidth: ArrayLike, size: int) -> Array:
    given = np.array(bandwidth, np.float64, ndmin=1)
    if given.shape != (size,) or not ((given > 0.0) & (given < np.inf)).all():
        raise ValueError(f"kernel density: {size} positive bandwidths are needed, got {given.tolist()}")
    return given
