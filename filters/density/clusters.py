"""Clustering of a particle set by k-means into a mixture of Gaussians (4.3.4), with k chosen by evidence.

For k = 1, 2, … a centre is added where k-means++ would (Arthur and Vassilvitskii, "k-means++: the advantages of
careful seeding", SODA 2007), Lloyd's iteration runs over scaled dimensions, and a few steps of classification EM
(Celeux and Govaert, "A classification EM algorithm for clustering and two stochastic versions", CSDA 14(3), 1992)
give each cluster its own metric, so that long clusters side by side and wide ones around narrow ones come apart.
k is the one of the largest classification evidence (the integrated completed likelihood of Biernacki, Celeux and
Govaert, IEEE PAMI 22(7), 2000, in BIC's approximation)

    n Σ wₖ (log wₖ - ½ log |Cₖ|) - ½ p log n,      p = k (1 + d + d (d + 1) / 2) - 1

n being the weighted *effective* sample size, not the count. By it a Gaussian is not worth splitting at any n: half a
Gaussian loses log 2 and its narrower variance gains only 0.51. Then pairs are merged while that raises the evidence,
every particle is assigned, and each cluster gets its weight, its mean (angles: atan2 of sums, which are over the
cluster's particles only) and its own covariance. Components lighter than a limit are left out, and their share said.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from filters.density import circular as angles
from filters.density.evidence import Fit, effective_size, evidence, merged_where_it_pays
from filters.density.mixture import Mixture
from filters.density.normal import of_moments
from filters.density.passes import Particles, Passes, Regions, regions_of
from filters.density.protocol import Array, DensityMoments
from filters.kernels import clusters as kernels
from filters.kernels import random
from filters.kernels.compile import Float32Array

TRIALS = 3
"""Candidates for each new centre, of which the best is taken (greedy k-means++)."""
LLOYD = 8
REFINEMENTS = 5
PATIENCE = 2
"""How many values of k in a row may fail to raise the evidence before the search ends."""
FINE = 1e-3
"""Least deviation of a cluster that counts for its evidence, relative to the whole set's, if none is given."""


class Clusters:
    """A clustering that allocates its buffers once, for particles in float32 columns.

    Parameters
    ----------
    circular : sequence of d bool
        Which of the dimensions wrap.
    most : int
        Largest k.
    scales : (d,) array, optional
        What counts as equally far in each dimension; the set's own deviations if not given.
    resolution : (d,) array, optional
        Deviations below which clusters are not told apart; a thousandth of the set's if not given. Copies of one
        particle are no hypothesis of their own.
    least_weight : float
        Lighter components are left out.
    sample : int
        How many particles the search for clusters looks at, evenly spaced among all. Weights, means and
        covariances are those of all.
    seed : int
        Of the candidates for centres. The same particles and seed give the same clusters.

    Raises
    ------
    ValueError
        A parameter out of range.
    """

    def __init__(
        self,
        circular: Sequence[bool],
        *,
        most: int = 8,
        scales: ArrayLike | None = None,
        resolution: ArrayLike | None = None,
        least_weight: float = 0.01,
        sample: int = 2048,
        seed: int = 0,
    ) -> None:
        size = len(circular)
        if size < 1 or most < 1 or sample < 1 or not 0.0 <= least_weight < 1.0:
            raise ValueError(
                f"clusters: at least one dimension, component and sample, and a least weight in [0, 1) are needed, "
                f"got {size}, {most}, {sample} and {least_weight}"
            )
        self.circular = np.array(circular, np.bool_)
        self._scales = _positive("scales", scales, size)
        self._resolution = _positive("resolution", resolution, size)
        self._most = most
        self._least_weight = least_weight
        self._seed = seed
        self._some: Float32Array = np.zeros((size, sample), np.float32)
        self._some_weights: Float32Array = np.zeros(sample, np.float32)
        self._passes = Passes(self.circular, most, sample)
        self._candidate_costs: Float32Array = np.zeros(sample, np.float32)
        self._candidate_labels = np.zeros(sample, np.int32)

    def extract(self, columns: Float32Array, weights: Float32Array, count: int) -> Mixture:
        """Cluster particles.

        Parameters
        ----------
        columns : (d, >= count) float32
            Angles in [-pi, pi]. The first rows of a particle filter's columns, as they are.
        weights : (>= count,) float32
            Not negative, up to a common factor.
        count : int
            How many particles there are.

        Raises
        ------
        ValueError
            Shapes that do not fit, no particle, or weights or states whose sums are not positive and finite.
        """
        size = self.circular.size
        if columns.shape[0] != size or not 1 <= count <= min(columns.shape[1], weights.size):
            raise ValueError(
                f"clusters: columns ({size}, count) and weights (count,) with count at least 1 are needed, got "
                f"{columns.shape}, {weights.shape} and a count of {count}"
            )
        few = min(count, self._some_weights.size)
        if self._some.shape[1] != few:
            self._resize(few)
        kernels.sample(columns, weights, count, self._some, self._some_weights)
        particles = Particles(columns, weights, count)
        whole = self._whole(particles)
        found = self._search(whole)
        if len(found.weights) == 1:
            return self._mixture(whole)
        return self._mixture(self._all(particles, found, self._least(whole)))

    # --- the search, over the sample ----------------------------------------------------------------------------

    @property
    def _sample(self) -> Particles:
        return Particles(self._some, self._some_weights, self._some_weights.size)

    def _search(self, whole: Fit) -> Fit:
        """Grow the number of clusters; return those of the largest evidence, merged where that raises it."""
        least = self._least(whole)
        deviation = np.sqrt(np.diag(whole.covariances[0]) + least)
        scales = deviation if self._scales is None else self._scales
        effective = effective_size(self._some_weights)
        best, best_evidence = whole, evidence(whole, effective, least)
        fit, since = whole, 0
        for _ in range(2, self._most + 1):
            fit = self._refine(self._lloyd(fit.means, scales), effective, least)
            found = evidence(fit, effective, least)
            since += 1
            if found > best_evidence:
                best, best_evidence, since = fit, found, 0
            if since == PATIENCE:
                break
        return merged_where_it_pays(best, effective, least, self.circular)

    def _lloyd(self, means: Array, scales: Array) -> Fit:
        """Add a centre and iterate: nearest centre, then mean of what is nearest."""
        size = self.circular.size
        k = len(means) + 1
        factors = np.tile(np.diag(1.0 / scales).astype(np.float32), (k, 1, 1))
        centres = np.concatenate([means, self._new_centre(means, factors)]).astype(np.float32)
        regions = Regions(centres, factors, np.zeros(k, np.float32))
        sums = np.zeros((k, 1 + size))
        for _ in range(LLOYD):
            step = self._passes.steps(self._sample, regions, sums)
            centres = angles.wrap_columns(regions.centres + step, self.circular)
            regions = regions._replace(centres=np.ascontiguousarray(centres, np.float32))
            if np.abs(step / scales).max() < 1e-3:
                break
        return self._passes.gather(self._sample, regions, regions.centres)

    def _new_centre(self, means: Array, factors: Float32Array) -> Array:
        """Choose among a few particles, drawn with probability weight times squared distance."""
        k = len(means)
        few = self._some_weights.size
        none = np.zeros(k, np.float32)
        self._passes.assign(self._some, 0, few, Regions(means.astype(np.float32), factors[:k], none))
        costs = self._passes.costs[:few]
        gathered: Array = np.cumsum(self._some_weights * costs, dtype=np.float64)
        least, chosen = math.inf, 0
        for trial in range(TRIALS):
            place = random.uniform(self._seed, k, trial) * float(gathered[-1])
            candidate = min(int(np.searchsorted(gathered, place)), few - 1)
            alone = Regions(np.ascontiguousarray(self._some[:, candidate])[None], factors[:1], none[:1])
            self._passes.assign_into(self._some, 0, few, alone, self._candidate_costs, self._candidate_labels)
            left = float(self._some_weights @ np.minimum(costs, self._candidate_costs))
            if left < least:
                least, chosen = left, candidate
        return self._some[:, chosen].astype(np.float64)[None]

    def _refine(self, fit: Fit, effective: float, least: Array) -> Fit:
        """Steps of classification EM: the cluster under whose Gaussian a particle is likeliest."""
        after = evidence(fit, effective, least)
        for _ in range(REFINEMENTS):
            if len(fit.weights) == 1:
                break
            regions = regions_of(fit, least)
            fit = self._passes.gather(self._sample, regions, regions.centres)
            before, after = after, evidence(fit, effective, least)
            if abs(after - before) < 0.5:
                break
        return fit

    # --- over all particles ---------------------------------------------------------------------------------------

    def _whole(self, particles: Particles) -> Fit:
        """Weight, mean and covariance of all particles, about their mean."""
        size = self.circular.size
        centres = np.ascontiguousarray(particles.columns[:, :1].T)
        regions = Regions(centres, np.zeros((1, size, size), np.float32), np.zeros(1, np.float32))
        fit = self._passes.gather(self._sample, regions, centres)
        fit = self._passes.gather(particles, regions, fit.means.astype(np.float32))
        if not np.isfinite(fit.covariances).all():
            raise ValueError("clusters: particles must be finite, their weights with a positive finite sum")
        return self._passes.about_its_means(particles, fit, regions)

    def _all(self, particles: Particles, found: Fit, least: Array) -> Fit:
        """Assign every particle to the clusters found, and gather them."""
        regions = regions_of(found, least)
        fit = self._passes.gather(particles, regions, regions.centres)
        if len(fit.weights) < len(regions.centres):
            return fit
        return self._passes.about_its_means(particles, fit, regions)

    def _mixture(self, fit: Fit) -> Mixture:
        """Return the clusters that are heavy enough, the heaviest first."""
        order = np.argsort(-fit.weights, kind="stable")
        kept = [int(k) for n, k in enumerate(order) if n == 0 or fit.weights[k] >= self._least_weight]
        weights = fit.weights[kept]
        components = [
            of_moments(DensityMoments(fit.means[k], fit.covariances[k]), self.circular) for k in kept
        ]
        return Mixture(weights, components, left_out=max(1.0 - float(weights.sum()), 0.0))

    def _least(self, whole: Fit) -> Array:
        """Variance that is added to a cluster's in the evidence."""
        if self._resolution is not None:
            return np.square(self._resolution)
        variance = np.diag(whole.covariances[0])
        return np.where(variance > 0.0, FINE**2 * variance, 1e-12)

    def _resize(self, few: int) -> None:
        """Take buffers for a smaller or larger sample: only when the count falls below the sample's size."""
        self._some = np.zeros((self.circular.size, few), np.float32)
        self._some_weights = np.zeros(few, np.float32)
        self._candidate_costs = np.zeros(few, np.float32)
        self._candidate_labels = np.zeros(few, np.int32)


def _positive(what: str, values: ArrayLike | None, size: int) -> Array | None:
    """Check a positive number for each dimension, if any is given."""
    if values is None:
        return None
    array = np.array(values, np.float64, ndmin=1)
    if array.shape != (size,) or not ((array > 0.0) & (array < np.inf)).all():
        raise ValueError(f"clusters: {what} must be {size} positive numbers, got {array.tolist()}")
    return array
