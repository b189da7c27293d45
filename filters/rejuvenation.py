"""After a collapse: weights tempered, and copies drawn apart by a kernel that is local.

A measurement that is far sharper than the belief leaves its weight with a few particles. Resampled, they are copies of
a few values, what those few leave out is lost for ever, and how the weight is shared between two places is a matter of
chance. Two things are done about it.

*Tempering.* The weights are raised to a power below one, the largest that leaves a wanted share of the particles
effective: the first of the bridging densities of annealing (Neal, "Annealed importance sampling", 2001), as Deutscher,
Blake and Reid took it to particle filters ("Articulated body motion capture by annealed particle filtering", 2000).
Annealing would take the rest of the measurement in at further steps. It is left out here, for what was weighed may be
many measurements, and the next one comes soon. So information is lost, and the belief errs on the wide side.

*Kernels.* Every copy is drawn anew from a Gaussian kernel about itself (regularised particle filter: Musso, Oudjane and
Le Gland, "Improving regularised particle filters", 2001). With the covariance of the whole set it would smear a ring
or two places into one another; so each kernel takes that of its neighbours. Neighbourhoods are the leaves of a k-d tree
over the different values there are, halved along the longest side until few are left in each; the bandwidth is that
for so few. Variance is added, and not made up for as by Liu and West: of the few values that are left even their
covariance is known badly, and mostly too small.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from filters.regularization import silverman

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

LEAF = 16
"""Different values in a neighbourhood, at least, where there are so many."""

LEAST_POWER = 1e-3
"""Where even this leaves too few particles effective, there are no others."""

HALVINGS = 12
"""Of the interval in which the power's logarithm lies: it is then known to one part in 600."""

CIRCLE = 2.0 * math.pi


def power(log_weights: NDArray[np.float32], share: float) -> float:
    """Return the largest power at most 1 to which the weights can be raised with ``share`` of them effective.

    Parameters
    ----------
    log_weights : (n,) float32
        NaN is a weight of zero.
    share : float
        Of n, that the effective sample size of the weights raised shall be, at least; in (0, 1].

    Raises
    ------
    ValueError
        A share outside (0, 1].
    """
    if not 0.0 < share <= 1.0:
        raise ValueError(f"temper: the share must lie in (0, 1], got {share}")
    logs = np.where(log_weights > -np.inf, log_weights, -np.inf)
    top = logs.max()
    if top == -np.inf:
        return 1.0
    logs -= top
    wanted = share * logs.size
    if _effective(logs) >= wanted:
        return 1.0
    low, high = LEAST_POWER, 1.0
    for _ in range(HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if _effective(np.float32(middle) * logs) >= wanted else (low, middle)
    return low


def _effective(logs: NDArray[np.float32]) -> float:
    weights = np.exp(logs)
    total = float(weights.sum(dtype=np.float64))
    return total * total / float(weights @ weights)


def spread(pose: NDArray[np.float32], normals: NDArray[np.float32], radians: float) -> Array:
    """Return every pose drawn anew from its local kernel.

    Parameters
    ----------
    pose : (3, n) float32
        North, east, heading; many may be the same.
    normals : (3, n) float32
        Standard normals: all the chance there is.
    radians : float
        How far a heading is off that counts like a metre: where to halve, of position and heading, depends on it.

    Returns
    -------
    (3, n) float64
        Headings in [-pi, pi).
    """
    _, kept, value = np.unique(pose[0], return_index=True, return_inverse=True)
    points = pose[:, kept].astype(np.float64)
    leaves = _leaves(points * [[1.0], [1.0], [1.0 / radians]])
    number, size = leaves.shape
    bandwidth = silverman(size, len(pose))
    near = points[:, leaves]
    away = near - near[:, :, :1]
    away[2] -= CIRCLE * np.round(away[2] / CIRCLE)
    away -= away.mean(axis=2, keepdims=True)
    covariance = np.einsum("ilk,jlk->lij", away, away) / size
    covariance[~np.isfinite(covariance).all(axis=(1, 2))] = 0.0
    values, vectors = np.linalg.eigh(covariance)
    roots = bandwidth * vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    leaf = np.empty(kept.size, np.int64)
    leaf[leaves] = np.arange(number)[:, None]
    drawn = pose + np.einsum("nij,jn->in", roots[leaf[value]], normals)
    drawn[2] = np.remainder(drawn[2] + math.pi, CIRCLE) - math.pi
    return drawn


def _leaves(points: Array) -> Indices:
    """Return which points are in which leaf, (leaves, size); a few are in two, so that all are of one size."""
    count = points.shape[1]
    levels = max(0, math.floor(math.log2(count / LEAF)))
    size = -(-count // 2**levels)
    total = size * 2**levels
    nodes: Indices = np.reshape(np.arange(total, dtype=np.int64) * count // total, (1, -1))
    for _ in range(levels):
        nodes = _halved(points, nodes)
    return nodes


def _halved(points: Array, nodes: Indices) -> Indices:
    """Halve every node along its longest side: (k, 2 n) to (2 k, n)."""
    rows = np.arange(len(nodes))
    near = points[:, nodes]
    along: Array = near[np.ptp(near, axis=2).argmax(axis=0), rows]
    halves = along.argpartition(nodes.shape[1] // 2, axis=1)
    return np.reshape(nodes[rows[:, None], halves], (2 * len(nodes), -1))
