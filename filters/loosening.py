"""The headings of a set drawn apart at a resampling, so that a good gyro does not leave copies of a few.

Between two resamplings noise moves the copies of a particle apart: along by the wheels', about by the gyro's. That of a
good gyro is so small that the set soon has the headings of few ancestors, none of them the true one, and is certain of
them. The remedy is the kernel of Liu and West ("Combined parameter and state estimation in simulation-based filtering",
2001), for that part r of a heading that nothing else about its particle tells, so that with nothing else its
correlation is lost::

    heading = mean + K (others - mean) + r,    K = Cov(heading, others) Cov(others)⁻¹
    heading' = heading - (1 - sqrt(1 - h²)) r + h sqrt(Var(r)) n,    n standard normal

Mean, variance and every covariance stay what they were; h is Silverman's bandwidth (:mod:`filters.regularization`).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from filters.regularization import silverman
from filters.reopening import CIRCLE, WIDEST_HEADING

Columns = NDArray[np.float32]

_TELLS = 1e-6
"""Of the largest, an eigenvalue of the others' correlations below which that direction tells nothing."""


def loosen(heading: Columns, others: Columns, effective_sample_size: float) -> tuple[Columns, float] | None:
    """Return what to take off the headings, and the variance of the noise to be added for it.

    Parameters
    ----------
    heading : (n,) float32
        Of equally weighted particles, radians.
    others : (k, n) float32
        All else that they have.
    effective_sample_size : float
        How many particles' worth of values there are.

    Returns
    -------
    tuple of (n,) float32 and float, or None
        ``None`` where the headings are spread too wide for a line to be drawn through them.
    """
    around = heading - heading[0]
    around -= CIRCLE * np.rint(around / CIRCLE)
    around -= around.mean()
    count = heading.size
    if not float(around @ around) / count <= WIDEST_HEADING**2:
        return None
    apart = others - others[:, :1]
    apart -= apart.mean(axis=1, keepdims=True)
    sigmas = np.sqrt(np.einsum("ij,ij->i", apart, apart, dtype=np.float64) / count)
    apart /= np.where(sigmas > 0.0, sigmas, 1.0).astype(np.float32)[:, None]
    values, vectors = np.linalg.eigh((apart @ apart.T).astype(np.float64) / count)
    told = values > _TELLS * values[-1]
    shared = (apart @ around).astype(np.float64) / count
    slopes = vectors[:, told] @ ((shared @ vectors[:, told]) / values[told])
    around -= slopes.astype(np.float32) @ apart
    bandwidth = min(1.0, silverman(max(1.0, effective_sample_size), len(others) + 1))
    variance = bandwidth * bandwidth * float(around @ around) / count
    return around * np.float32(1.0 - math.sqrt(1.0 - bandwidth * bandwidth)), variance
