"""Resampling schemes, with one signature for the family: ``(weights, count, uniform) -> ancestors``.

A scheme says which particle each new one is a copy of. The target count may differ from the source count. The
ancestors ascend; who lays the copies out decides their order.
"""

from __future__ import annotations

import math

import numpy as np

from filters.kernels import resampling as kernels
from filters.kernels.compile import Float32Array, Int32Array


def systematic(
    weights: Float32Array, count: int, uniform: float, ancestors: Int32Array | None = None
) -> Int32Array:
    """Draw with one random number: Table 4.4, Low_variance_sampler, with equation 4.37.

    Parameters
    ----------
    weights : (n,) float32
        Not negative, not necessarily normalised, with a positive finite sum.
    count : int
        How many to draw, at least 1.
    uniform : float
        The random number, in (0, 1]: the table's r times M. Zero would choose a first particle of weight
        zero.
    ancestors : (count,) int32, optional
        Where to write them; allocated if not given.

    Returns
    -------
    (count,) int32
        Indices into ``weights``, ascending; index i occurs floor or ceiling of ``count * weights[i] / sum``
        times.

    Raises
    ------
    ValueError
        A count below 1, a uniform outside (0, 1], or weights whose sum is not positive and finite.
    """
    if count < 1:
        raise ValueError(f"systematic resampling: count must be at least 1, got {count}")
    if not 0.0 < uniform <= 1.0:
        raise ValueError(f"systematic resampling: uniform must lie in (0, 1], got {uniform}")
    total = kernels.total(weights)
    if not 0.0 < total < math.inf:
        raise ValueError(f"systematic resampling: the weights must have a positive finite sum, got {total}")
    if ancestors is None:
        ancestors = np.empty(count, np.int32)
    kernels.systematic(weights, total, uniform, ancestors)
    return ancestors
