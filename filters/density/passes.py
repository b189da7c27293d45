"""Passes over particles: each to its cluster, and each cluster's moments.

What a cluster is told by is a centre, a factor and a constant: z'z + constant with z = factor (x - centre) is the least
for the cluster that a particle belongs to. Blocks of particles go through kernels that write to buffers allocated once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from filters.density import circular as angles
from filters.density.circular import Flags
from filters.density.evidence import Fit
from filters.density.protocol import Array
from filters.kernels import clusters as kernels
from filters.kernels.compile import Float32Array

BLOCK = 8192
"""Particles that are assigned at once."""
LANES = 1024
"""Width of the kernel's scratch."""
WIDE = 0.25
"""Variance of an angle from which on some particles may lie near the far side of the circle."""


class Particles(NamedTuple):
    """A particle set: columns (d, >= count), weights (>= count,) up to a factor, and how many there are."""

    columns: Float32Array
    weights: Float32Array
    size: int


class Regions(NamedTuple):
    """Which particles belong to which of k clusters: centres (k, d), factors (k, d, d), constants (k,)."""

    centres: Float32Array
    factors: Float32Array
    constants: Float32Array


def regions_of(fit: Fit, least: Array) -> Regions:
    """Return the regions in which each Gaussian is the likeliest: z'z + constant is minus twice log w N(x; mean, C).

    Parameters
    ----------
    least : (d,) array
        Variance that is added to each covariance.
    """
    roots = np.linalg.cholesky(fit.covariances + np.diag(least))
    factors = np.linalg.inv(roots)
    logs = np.log(np.diagonal(roots, axis1=1, axis2=2)).sum(axis=1)
    constants = 2.0 * (logs - np.log(fit.weights))
    return Regions(
        fit.means.astype(np.float32),
        np.ascontiguousarray(factors, np.float32),
        (constants - constants.min()).astype(np.float32),
    )


class Passes:
    """The passes, with their buffers.

    Parameters
    ----------
    circular : (d,) bool
        Which of the dimensions wrap.
    most : int
        Largest number of clusters.
    longest : int
        How many particles may be assigned at once.

    Attributes
    ----------
    costs : (>= longest,) float32
        z'z + constant of every particle that was assigned last.
    labels : (>= longest,) int32
        The clusters they belong to.
    """

    def __init__(self, circular: Flags, most: int, longest: int) -> None:
        size = circular.size
        self.costs: Float32Array = np.zeros(max(longest, BLOCK), np.float32)
        self.labels = np.zeros(max(longest, BLOCK), np.int32)
        self._circular = circular
        self._scratch: Float32Array = np.zeros((size + 2, LANES), np.float32)
        self._sums = np.zeros((most, 1 + 3 * size + size * (size + 1) // 2))
        self._away = np.zeros(size)
        self._lower = np.tril_indices(size)

    def assign(self, columns: Float32Array, first: int, last: int, regions: Regions) -> None:
        """Write the labels and costs of the particles from ``first`` to before ``last``, from 0 on."""
        self.assign_into(columns, first, last, regions, self.costs, self.labels)

    def assign_into(
        self,
        columns: Float32Array,
        first: int,
        last: int,
        regions: Regions,
        costs: Float32Array,
        labels: NDArray[np.int32],
    ) -> None:
        """Write labels and costs elsewhere."""
        kernels.assign(columns, first, last, *regions, self._circular, self._scratch, costs, labels)

    def steps(self, particles: Particles, regions: Regions, sums: Array) -> Array:
        """Assign, and return how far the mean of each cluster lies from its centre, (k, d); ``sums``: (k, 1 + d)."""
        self.assign(particles.columns, 0, particles.size, regions)
        sums[:] = 0.0
        kernels.first_moments(
            particles.columns, particles.weights, 0, particles.size, self.labels, regions.centres,
            self._circular, sums,
        )  # fmt: skip
        return sums[:, 1:] / np.maximum(sums[:, :1], 1e-300)

    def gather(self, particles: Particles, regions: Regions, references: Float32Array) -> Fit:
        """Assign and take each cluster's moments about its reference; clusters that nothing belongs to are gone."""
        columns, weights, count = particles
        sums = self._sums[: len(regions.centres)]
        sums[:] = 0.0
        for first in range(0, count, BLOCK):
            last = min(first + BLOCK, count)
            self.assign(columns, first, last, regions)
            kernels.second_moments(
                columns, weights, first, last, self.labels, references, self._circular, sums, self._away
            )
        there = sums[:, 0] > 0.0
        if not there.any():
            raise ValueError("clusters: particles must be finite, their weights with a positive finite sum")
        return self._fit(sums[there], references[there])

    def _fit(self, total: Array, references: Float32Array) -> Fit:
        """Return the clusters of which these are the sums about their references."""
        size = self._circular.size
        mass = total[:, 0]
        total = total / mass[:, None]
        away = total[:, 1 : 1 + size]
        offset = away.copy()
        across, along = total[:, 1 + size : 1 + 2 * size], total[:, 1 + 2 * size : 1 + 3 * size]
        offset[:, self._circular] = np.arctan2(across, along)[:, self._circular]
        second = np.zeros((len(total), size, size))
        second[:, self._lower[0], self._lower[1]] = total[:, 1 + 3 * size :]
        second[:, self._lower[1], self._lower[0]] = total[:, 1 + 3 * size :]
        cross = np.einsum("ki,kj->kij", offset, away)
        covariances = second - cross - cross.transpose(0, 2, 1) + np.einsum("ki,kj->kij", offset, offset)
        means = angles.wrap_columns(references + offset, self._circular)
        return Fit(mass / mass.sum(), means, covariances)

    def about_its_means(self, particles: Particles, fit: Fit, regions: Regions) -> Fit:
        """Gather again about the means if angles are wide: they wrap elsewhere about them than about the centres."""
        if not (fit.covariances[:, self._circular, self._circular] > WIDE).any():
            return fit
        return self.gather(particles, regions, fit.means.astype(np.float32))
