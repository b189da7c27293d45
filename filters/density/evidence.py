"""What a clustering is worth: the classification evidence of its Gaussians, and whether fewer of them are worth more.

The criterion and its sources stand in :mod:`filters.density.clusters`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from filters.density import circular as angles
from filters.density.circular import Flags
from filters.density.protocol import Array
from filters.kernels.compile import Float32Array

Indices = NDArray[np.int64]


class Fit(NamedTuple):
    """Clusters: weights (k,) that sum to one, means (k, d), covariances (k, d, d)."""

    weights: Array
    means: Array
    covariances: Array


def effective_size(weights: Float32Array) -> float:
    """Return (Σ w)² / Σ w²."""
    total = float(weights.sum(dtype=np.float64))
    return total * total / max(float(np.square(weights, dtype=np.float64).sum()), 1e-300)


def scores(fit: Fit, least: Array) -> Array:
    """Return w (log w - ½ log |C|) of each cluster."""
    widened = fit.covariances + np.diag(least)
    return fit.weights * (np.log(fit.weights) - 0.5 * np.linalg.slogdet(widened)[1])


def evidence(fit: Fit, effective: float, least: Array) -> float:
    """Return the classification evidence; minus infinity if a cluster has too few particles for a covariance."""
    k, size = fit.means.shape
    if k > 1 and effective * float(fit.weights.min()) < size + 1:
        return -math.inf
    parameters = k * (1 + size + size * (size + 1) // 2) - 1
    return effective * float(scores(fit, least).sum()) - 0.5 * parameters * math.log(max(effective, 1.0))


def merged_where_it_pays(fit: Fit, effective: float, least: Array, circular: Flags) -> Fit:
    """Merge the pair that raises the evidence most, until none does."""
    size = circular.size
    penalty = 0.5 * (1 + size + size * (size + 1) // 2) * math.log(max(effective, 1.0))
    while len(fit.weights) > 1:
        one, other = np.triu_indices(len(fit.weights), 1)
        before = scores(fit, least)
        pairs = _pairs(fit, one, other, circular)
        gain = effective * (scores(pairs, least) - before[one] - before[other]) + penalty
        top = int(gain.argmax())
        if gain[top] <= 0.0:
            break
        kept = np.delete(np.arange(len(fit.weights)), [one[top], other[top]])
        fit = Fit(*(np.concatenate([a[kept], b[top : top + 1]]) for a, b in zip(fit, pairs, strict=True)))
    return fit


def _pairs(fit: Fit, one: Indices, other: Indices, circular: Flags) -> Fit:
    """Return the clusters that pairs of clusters would be."""
    a, b = (Fit(*(field[index] for field in fit)) for index in (one, other))
    total = a.weights + b.weights
    share = b.weights / total
    apart = angles.difference(b.means, a.means, circular)
    spread = np.einsum("k,ki,kj->kij", share * (1.0 - share), apart, apart)
    inside = a.covariances * (1.0 - share)[:, None, None] + b.covariances * share[:, None, None]
    means = angles.wrap_columns(a.means + apart * share[:, None], circular)
    return Fit(total, means, inside + spread)
