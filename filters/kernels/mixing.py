"""Gaussians mixed before a step of interacting models; see :mod:`filters.linearised.interacting`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from filters.kernels.compile import function, kernel

Float64Array = NDArray[np.float64]


@function
def mixing_weights(transition: Float64Array, belief: Float64Array, weights: Float64Array) -> None:
    """Write w_i|j = p_ij mu_i / c_j; a model that nothing turns into keeps what it has."""
    members = belief.size
    for j in range(members):
        total = 0.0
        for i in range(members):
            total += transition[i, j] * belief[i]
        for i in range(members):
            weights[i, j] = transition[i, j] * belief[i] / total if total > 0.0 else 0.0
        if not total > 0.0:
            weights[j, j] = 1.0


@function
def add_spread(weight: float, before: Float64Array, apart: Float64Array, covariance: Float64Array) -> None:
    """Add ``weight`` times a covariance and its mean's square about the mixture's."""
    for k in range(apart.size):
        for q in range(apart.size):
            covariance[k, q] += weight * (before[k, q] + apart[k] * apart[q])


@kernel("void(float64[:, ::1], float64[:, :, ::1], float64[:, ::1], float64[::1], int64)", exact=True)
def mix_gaussians(
    mean: Float64Array, covariance: Float64Array, transition: Float64Array, belief: Float64Array, angle: int
) -> None:
    """Replace Gaussian j by the mixture of all, weighted by w_i|j; one dimension is an angle."""
    members, size = mean.shape
    weights = np.empty((members, members))
    mixing_weights(transition, belief, weights)
    reference, before = mean[0].copy(), covariance.copy()
    away, mixed = np.empty((members, size)), np.zeros((members, size))
    for i in range(members):
        away[i] = mean[i] - reference
        away[i, angle] = (away[i, angle] + math.pi) % (2.0 * math.pi) - math.pi
        for j in range(members):
            mixed[j] += weights[i, j] * away[i]
    covariance[:, :, :] = 0.0
    for j in range(members):
        for i in range(members):
            add_spread(weights[i, j], before[i], away[i] - mixed[j], covariance[j])
        mean[j] = reference + mixed[j]
        mean[j, angle] = (mean[j, angle] + math.pi) % (2.0 * math.pi) - math.pi
