"""The k-means mixture of a particle set in float64 (4.3.4), by :mod:`filters.density.clusters`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from filters.density.clusters import Clusters
from filters.density.mixture import Mixture
from filters.density.weighted import weighted


class KMeans:
    """The :class:`~filters.density.protocol.Extractor` of a k-means mixture, for points in float64.

    Parameters
    ----------
    most, scales, resolution, least_weight, sample, seed
        As of :class:`Clusters`; by default the search looks at up to 16,384 particles.
    """

    def __init__(
        self,
        *,
        most: int = 8,
        scales: ArrayLike | None = None,
        resolution: ArrayLike | None = None,
        least_weight: float = 0.01,
        sample: int = 16384,
        seed: int = 0,
    ) -> None:
        self._most = most
        self._scales = scales
        self._resolution = resolution
        self._least_weight = least_weight
        self._sample = sample
        self._seed = seed

    def __call__(
        self, points: ArrayLike, weights: ArrayLike | None = None, circular: Sequence[bool] | None = None
    ) -> Mixture:
        """Cluster a particle set.

        Raises
        ------
        ValueError
            As the protocol says, or a parameter that does not fit the dimensions.
        """
        particles = weighted("k-means", points, weights, circular)
        clusters = Clusters(
            [bool(flag) for flag in particles.circular],
            most=self._most,
            scales=self._scales,
            resolution=self._resolution,
            least_weight=self._least_weight,
            sample=self._sample,
            seed=self._seed,
        )
        origin = np.where(particles.circular, 0.0, particles.weights @ particles.points)
        columns = np.ascontiguousarray((particles.points - origin).T, np.float32)
        share = (particles.weights / particles.weights.max()).astype(np.float32)
        found = clusters.extract(columns, share, len(share))
        components = [
            type(each)(each.mean + origin, each.covariance, [*each.circular]) for each in found.components
        ]
        return Mixture(found.weights, components, found.left_out)
