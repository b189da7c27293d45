"""Marginalised slow states opened again at a resampling, so that they never hang on the few ancestors left.

A marginalised state (a gyro's bias, an odometer's scale) is a mean m in each particle, given that particle's path, and
one variance P that all share. The more a path has told, the smaller is P, and the more of what is known lies in how the
particles' means differ: in the end in what few ancestors happened to draw. But to go on, the belief needs no paths,
only poses. Given the pose x alone, the state is spread by P and by what is left of the means when x is known::

    m = mean + K (x - mean) + r,    K = Cov(m, x) Cov(x)⁻¹,    r uncorrelated with x
    m' = m - (1 - sqrt(1 - h²)) r,  P' = P + h² Var(r)

Mean, variance and covariance with the pose stay what they were. It is the shrinkage of Liu and West ("Combined
parameter and state estimation in simulation-based filtering", 2001), but nothing is drawn from the kernel: its variance
goes where a Kalman filter keeps it, and the motion's own draws tell the particles apart again. With h = 1 and a
Gaussian belief that is exact. A belief need not be Gaussian, so h is Silverman's bandwidth for a kernel over pose and
states (:mod:`filters.regularization`).

A state that is sampled (a receiver's delay) has no P: its h² Var(r) is drawn as noise, as Liu and West do, of each by
itself.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from filters.regularization import silverman

Columns = NDArray[np.float32]

WIDEST_HEADING = 0.35
"""Standard deviation, rad, up to which headings are a line and no circle; wider, nothing is opened."""

CIRCLE = np.float32(2.0 * math.pi)
_TELLS = 1e-6
"""Of the largest, an eigenvalue of the pose's correlations below which that direction tells nothing."""


def reopen(
    pose: Columns, means: Columns, effective_sample_size: float
) -> tuple[Columns, NDArray[np.float64]] | None:
    """Return what to take off the means, and the variance that it comes to.

    Parameters
    ----------
    pose : (3, n) float32
        North, east, heading of equally weighted particles.
    means : (k, n) float32
        Of each marginalised state.
    effective_sample_size : float
        How many particles' worth of values there are.

    Returns
    -------
    tuple of (k, n) float32 and (k,) float64, or None
        ``None`` where the headings are spread too wide for a line to be drawn through them.
    """
    around: Columns = pose - pose[:, :1]
    around[2] -= CIRCLE * np.rint(around[2] / CIRCLE)
    around -= around.mean(axis=1, keepdims=True)
    sigmas = np.sqrt(np.einsum("ij,ij->i", around, around, dtype=np.float64) / pose.shape[1])
    if not sigmas[2] <= WIDEST_HEADING:
        return None
    around /= np.where(sigmas > 0.0, sigmas, 1.0).astype(np.float32)[:, None]
    apart: Columns = means - means.mean(axis=1, keepdims=True)
    alike = np.einsum("ik,jk->ij", around, around) / pose.shape[1]
    shared = np.einsum("ik,jk->ij", apart, around) / pose.shape[1]
    values, vectors = np.linalg.eigh(alike)
    told = values > _TELLS * values[-1]
    slopes = shared @ vectors[:, told] / values[told] @ vectors[:, told].T
    apart -= np.asarray(slopes, np.float32) @ around
    bandwidth = min(1.0, silverman(max(1.0, effective_sample_size), len(pose) + len(means)))
    variances = np.einsum("ij,ij->i", apart, apart, dtype=np.float64) / pose.shape[1]
    apart *= np.float32(1.0 - math.sqrt(1.0 - bandwidth * bandwidth))
    return apart, bandwidth * bandwidth * variances
