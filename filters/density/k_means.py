"""k-means clustering of a particle set into a mixture of Gaussians (4.3.4), with k chosen by evidence.

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
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from filters.density import circular as angles
from filters.density.mixture import Mixture
from filters.density.normal import of_moments
from filters.density.protocol import Array, DensityMoments
from filters.density.weighted import weighted
from filters.kernels import clusters as kernels
from filters.kernels import random
from filters.kernels.compile import Float32Array

Indices = NDArray[np.int64]

BLOCK = 8192
"""Particles that are assigned at once."""
LANES = 1024
"""Width of the kernel's scratch."""
TRIALS = 3
"""Candidates for each new centre, of which the best is taken (greedy k-means++)."""
LLOYD = 8
REFINEMENTS = 5
PATIENCE = 2
"""How many values of k in a row may fail to raise the evidence before the search ends."""
WIDE = 0.25
"""Variance of an angle from which on some particles may lie near the far side of the circle."""
FINE = 1e-3
"""Least deviation of a cluster that counts for its evidence, relative to the whole set's, if none is given."""


class Fit(NamedTuple):
    """Clusters: weights (k,) that sum to one, means (k, d), covariances (k, d, d)."""

    weights: Array
    means: Array
    covariances: Array


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
        self._scratch: Float32Array = np.zeros((size + 2, LANES), np.float32)
        self._costs: Float32Array = np.zeros(max(sample, BLOCK), np.float32)
        self._candidate_costs: Float32Array = np.zeros(sample, np.float32)
        self._labels = np.zeros(max(sample, BLOCK), np.int32)
        self._candidate_labels = np.zeros(sample, np.int32)
        self._sums = np.zeros((most, 1 + 3 * size + size * (size + 1) // 2))
        self._away = np.zeros(size)
        self._lower = np.tril_indices(size)

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
        whole = self._whole(columns, weights, count)
        found = self._search(whole)
        if len(found.weights) == 1:
            return self._mixture(whole)
        return self._mixture(self._all(columns, weights, count, found, self._least(whole)))

    # --- the search, over the sample ----------------------------------------------------------------------------

    def _search(self, whole: Fit) -> Fit:
        """Grow the number of clusters; return those of the largest evidence, merged where that raises it."""
        least = self._least(whole)
        deviation = np.sqrt(np.diag(whole.covariances[0]) + least)
        scales = deviation if self._scales is None else self._scales
        effective = _effective(self._some_weights)
        best, best_evidence = whole, self._evidence(whole, effective, least)
        fit, since = whole, 0
        for _ in range(2, self._most + 1):
            fit = self._refine(self._lloyd(fit.means, scales), effective, least)
            evidence = self._evidence(fit, effective, least)
            since += 1
            if evidence > best_evidence:
                best, best_evidence, since = fit, evidence, 0
            if since == PATIENCE:
                break
        return self._merge(best, effective, least)

    def _lloyd(self, means: Array, scales: Array) -> Fit:
        """Add a centre and iterate: nearest centre, then mean of what is nearest."""
        size = self.circular.size
        k = len(means) + 1
        factors = np.tile(np.diag(1.0 / scales).astype(np.float32), (k, 1, 1))
        constants = np.zeros(k, np.float32)
        centres = np.concatenate([means, self._new_centre(means, factors)]).astype(np.float32)
        few = self._some_weights.size
        sums = np.zeros((k, 1 + size))
        for _ in range(LLOYD):
            self._assign(self._some, 0, few, centres, factors, constants)
            sums[:] = 0.0
            kernels.first_moments(
                self._some, self._some_weights, 0, few, self._labels, centres, self.circular, sums
            )
            step = sums[:, 1:] / np.maximum(sums[:, :1], 1e-300)
            centres = np.ascontiguousarray(angles.wrap_columns(centres + step, self.circular), np.float32)
            if np.abs(step / scales).max() < 1e-3:
                break
        return self._gather(self._some, self._some_weights, few, centres, factors, constants, centres)

    def _new_centre(self, means: Array, factors: Float32Array) -> Array:
        """Choose among a few particles, drawn with probability weight times squared distance."""
        k = len(means)
        few = self._some_weights.size
        none = np.zeros(k, np.float32)
        self._assign(self._some, 0, few, means.astype(np.float32), factors[:k], none)
        costs = self._costs[:few]
        gathered: Array = np.cumsum(self._some_weights * costs, dtype=np.float64)
        least, chosen = math.inf, 0
        for trial in range(TRIALS):
            place = random.uniform(self._seed, k, trial) * float(gathered[-1])
            candidate = min(int(np.searchsorted(gathered, place)), few - 1)
            kernels.assign(
                self._some,
                0,
                few,
                np.ascontiguousarray(self._some[:, candidate])[None],
                factors[:1],
                none[:1],
                self.circular,
                self._scratch,
                self._candidate_costs,
                self._candidate_labels,
            )
            left = float(self._some_weights @ np.minimum(costs, self._candidate_costs))
            if left < least:
                least, chosen = left, candidate
        return self._some[:, chosen].astype(np.float64)[None]

    def _refine(self, fit: Fit, effective: float, least: Array) -> Fit:
        """Steps of classification EM: the cluster under whose Gaussian a particle is likeliest."""
        evidence = self._evidence(fit, effective, least)
        for _ in range(REFINEMENTS):
            if len(fit.weights) == 1:
                break
            factors, constants = _metric(fit, least)
            centres = fit.means.astype(np.float32)
            few = self._some_weights.size
            refined = self._gather(self._some, self._some_weights, few, centres, factors, constants, centres)
            before, evidence = evidence, self._evidence(refined, effective, least)
            fit = refined
            if abs(evidence - before) < 0.5:
                break
        return fit

    def _evidence(self, fit: Fit, effective: float, least: Array) -> float:
        """Return the classification evidence; minus infinity if a cluster has too few particles for a covariance."""
        k, size = fit.means.shape
        if k > 1 and effective * float(fit.weights.min()) < size + 1:
            return -math.inf
        parameters = k * (1 + size + size * (size + 1) // 2) - 1
        return effective * float(_scores(fit, least).sum()) - 0.5 * parameters * math.log(max(effective, 1.0))

    def _merge(self, fit: Fit, effective: float, least: Array) -> Fit:
        """Merge the pair that raises the evidence most, until none does."""
        size = self.circular.size
        penalty = 0.5 * (1 + size + size * (size + 1) // 2) * math.log(max(effective, 1.0))
        while len(fit.weights) > 1:
            one, other = np.triu_indices(len(fit.weights), 1)
            scores = _scores(fit, least)
            pairs = self._merged(fit, one, other)
            gain = effective * (_scores(pairs, least) - scores[one] - scores[other]) + penalty
            top = int(gain.argmax())
            if gain[top] <= 0.0:
                break
            kept = np.delete(np.arange(len(fit.weights)), [one[top], other[top]])
            fit = Fit(*(np.concatenate([a[kept], b[top : top + 1]]) for a, b in zip(fit, pairs, strict=True)))
        return fit

    def _merged(self, fit: Fit, one: Indices, other: Indices) -> Fit:
        """Return the clusters that pairs of clusters would be."""
        a, b = (Fit(*(field[index] for field in fit)) for index in (one, other))
        total = a.weights + b.weights
        share = b.weights / total
        apart = angles.difference(b.means, a.means, self.circular)
        spread = np.einsum("k,ki,kj->kij", share * (1.0 - share), apart, apart)
        inside = a.covariances * (1.0 - share)[:, None, None] + b.covariances * share[:, None, None]
        means = angles.wrap_columns(a.means + apart * share[:, None], self.circular)
        return Fit(total, means, inside + spread)

    # --- passes over particles ------------------------------------------------------------------------------------

    def _whole(self, columns: Float32Array, weights: Float32Array, count: int) -> Fit:
        """Weight, mean and covariance of all particles, about their mean."""
        size = self.circular.size
        factors = np.zeros((1, size, size), np.float32)
        constants = np.zeros(1, np.float32)
        centres = np.ascontiguousarray(columns[:, :1].T)
        few = self._some_weights.size
        fit = self._gather(self._some, self._some_weights, few, centres, factors, constants, centres)
        means = fit.means.astype(np.float32)
        fit = self._gather(columns, weights, count, centres, factors, constants, means)
        if not np.isfinite(fit.covariances).all():
            raise ValueError("clusters: particles must be finite, their weights with a positive finite sum")
        return self._about_its_means(columns, weights, count, fit, centres, factors, constants)

    def _all(self, columns: Float32Array, weights: Float32Array, count: int, found: Fit, least: Array) -> Fit:
        """Assign every particle to the clusters found, and gather them."""
        factors, constants = _metric(found, least)
        centres = found.means.astype(np.float32)
        fit = self._gather(columns, weights, count, centres, factors, constants, centres)
        if len(fit.weights) < len(centres):
            return fit
        return self._about_its_means(columns, weights, count, fit, centres, factors, constants)

    def _about_its_means(
        self,
        columns: Float32Array,
        weights: Float32Array,
        count: int,
        fit: Fit,
        centres: Float32Array,
        factors: Float32Array,
        constants: Float32Array,
    ) -> Fit:
        """Gather again about the means if angles are wide: they wrap elsewhere about them than about the centres."""
        if not (fit.covariances[:, self.circular, self.circular] > WIDE).any():
            return fit
        means = fit.means.astype(np.float32)
        return self._gather(columns, weights, count, centres, factors, constants, means)

    def _gather(
        self,
        columns: Float32Array,
        weights: Float32Array,
        count: int,
        centres: Float32Array,
        factors: Float32Array,
        constants: Float32Array,
        references: Float32Array,
    ) -> Fit:
        """Assign particles and take each cluster's moments; clusters that nothing belongs to are gone."""
        sums = self._sums[: len(centres)]
        sums[:] = 0.0
        for first in range(0, count, BLOCK):
            last = min(first + BLOCK, count)
            self._assign(columns, first, last, centres, factors, constants)
            kernels.second_moments(
                columns, weights, first, last, self._labels, references, self.circular, sums, self._away
            )
        size = self.circular.size
        there = sums[:, 0] > 0.0
        if not there.any():
            raise ValueError("clusters: particles must be finite, their weights with a positive finite sum")
        total = sums[there]
        mass = total[:, 0]
        total = total / mass[:, None]
        away = total[:, 1 : 1 + size]
        offset = away.copy()
        across, along = total[:, 1 + size : 1 + 2 * size], total[:, 1 + 2 * size : 1 + 3 * size]
        offset[:, self.circular] = np.arctan2(across, along)[:, self.circular]
        second = np.zeros((len(total), size, size))
        second[:, self._lower[0], self._lower[1]] = total[:, 1 + 3 * size :]
        second[:, self._lower[1], self._lower[0]] = total[:, 1 + 3 * size :]
        cross = np.einsum("ki,kj->kij", offset, away)
        covariances = second - cross - cross.transpose(0, 2, 1) + np.einsum("ki,kj->kij", offset, offset)
        means = angles.wrap_columns(references[there] + offset, self.circular)
        return Fit(mass / mass.sum(), means, covariances)

    def _assign(
        self,
        columns: Float32Array,
        first: int,
        last: int,
        centres: Float32Array,
        factors: Float32Array,
        constants: Float32Array,
    ) -> None:
        kernels.assign(
            columns,
            first,
            last,
            centres,
            factors,
            constants,
            self.circular,
            self._scratch,
            self._costs,
            self._labels,
        )

    # --- the rest -------------------------------------------------------------------------------------------------

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


def _positive(what: str, values: ArrayLike | None, size: int) -> Array | None:
    """Check a positive number for each dimension, if any is given."""
    if values is None:
        return None
    array = np.array(values, np.float64, ndmin=1)
    if array.shape != (size,) or not ((array > 0.0) & (array < np.inf)).all():
        raise ValueError(f"clusters: {what} must be {size} positive numbers, got {array.tolist()}")
    return array


def _effective(weights: Float32Array) -> float:
    """Return (Σ w)² / Σ w²."""
    total = float(weights.sum(dtype=np.float64))
    return total * total / max(float(np.square(weights, dtype=np.float64).sum()), 1e-300)


def _scores(fit: Fit, least: Array) -> Array:
    """Return w (log w - ½ log |C|) of each cluster."""
    widened = fit.covariances + np.diag(least)
    return fit.weights * (np.log(fit.weights) - 0.5 * np.linalg.slogdet(widened)[1])


def _metric(fit: Fit, least: Array) -> tuple[Float32Array, Float32Array]:
    """Return what makes of z'z + constant minus twice the log of w N(x; mean, C): inverse roots, constants."""
    roots = np.linalg.cholesky(fit.covariances + np.diag(least))
    factors = np.linalg.inv(roots)
    logs = np.log(np.diagonal(roots, axis1=1, axis2=2)).sum(axis=1)
    constants = 2.0 * (logs - np.log(fit.weights))
    return np.ascontiguousarray(factors, np.float32), (constants - constants.min()).astype(np.float32)
