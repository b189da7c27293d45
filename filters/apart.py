"""Copies of one place drawn apart: the kernel of Liu and West over everything that particles differ in.

While a belief is of several places (:mod:`filters.hypotheses`), each place is as well sampled as its own particles are
different. A resampling leaves copies; what they all happen to have wrong, a heading or a scale that nothing told yet,
costs that place evidence for as long as nobody is left who has it right. So the share of the belief wanders, by
chance and not by evidence. The regularised resampling of Liu and West ("Combined parameter and state estimation in
simulation-based filtering", 2001) fills the gaps and keeps mean and covariance of all columns together::

    x' = mean + sqrt(1 - h²) (x - mean) + h L n,        L Lᵀ = Cov(x), n standard normal

with Silverman's bandwidth h for as many particles as were effective. The kernel is Gaussian: it fits one place, small
enough for a straight line to be one, and not a ring or two places. Others are left as they are.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from filters.regularization import Preserving, root

Columns = NDArray[np.float32]

WIDEST_HEADING = 0.35
"""Standard deviation, rad, up to which headings are a line and no circle."""

FEWEST = 8
"""Particles for each column, below which their covariance is known too badly to draw by."""

CIRCLE = 2.0 * math.pi


def drawn_apart(
    columns: Columns, normals: Columns, effective_sample_size: float, widest: float
) -> NDArray[np.float64] | None:
    """Return the particles of one place drawn anew from kernels about themselves.

    Parameters
    ----------
    columns : (d, n) float32
        North, east, heading, and the slow states beside them, of equally weighted particles.
    normals : (d, n) float32
        Standard normals: all the chance there is.
    effective_sample_size : float
        Before they were resampled, at least 1.
    widest : float
        Metres; the standard deviation north or east up to which they are one place.

    Returns
    -------
    (d, n) float64 or None
        Headings in [-pi, pi); ``None`` where they are too few, or spread too wide for a Gaussian.
    """
    dimension, count = columns.shape
    if count < FEWEST * dimension:
        return None
    first = columns[:, :1].astype(np.float64)
    away = columns - first
    away[2] -= CIRCLE * np.rint(away[2] / CIRCLE)
    mean = away.mean(axis=1, keepdims=True)
    away -= mean
    covariance = away @ away.T / count
    sigmas = np.sqrt(np.diag(covariance)[:3])
    if not (sigmas[:2].max() <= widest and sigmas[2] <= WIDEST_HEADING):
        return None
    factor, bandwidth = Preserving().kernel(effective_sample_size, dimension)
    scale = np.sqrt(np.diag(covariance))
    scale[scale <= 0.0] = 1.0
    spread = bandwidth * scale[:, None] * root(covariance / np.outer(scale, scale))
    drawn = first + mean + factor * away + spread @ normals
    drawn[2] = np.remainder(drawn[2] + math.pi, CIRCLE) - math.pi
    return drawn
