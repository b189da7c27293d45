"""Stratified sampling with any allocation: how many of each label, and then within it (section 4.3.4).

Where a stratum is given more or fewer draws than its weight is worth, each of its draws is worth the stratum's weight
over their number (Cochran, *Sampling Techniques*, 3rd ed. 1977, section 5.1): unbiased, and the strata's shares are
exactly kept.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from filters.kernels import labelled, schemes
from filters.kernels.compile import Float32Array, Int32Array
from filters.resampling import numbers


def draw(
    weights: Float32Array,
    labels: Int32Array,
    quotas: NDArray[np.int64],
    uniform: float,
    ancestors: Int32Array,
) -> Float32Array:
    """Draw each label's quota among its own by Table 4.4, and return the logarithm of what one draw of each is worth.

    Parameters
    ----------
    weights : (n,) float32
        Not negative, with a positive finite sum.
    labels : (>= n,) int32
        From 0, below the number of quotas.
    quotas : (number of labels,) int64
    uniform : float
        All the chance there is, in (0, 1].
    ancestors : (sum of quotas,) int32
        Where to write them; they ascend.

    Raises
    ------
    ValueError
        Too few labels, quotas that do not sum to the number of ancestors, that are negative, not zero where a label has
        no weight, or all zero.
    """
    count = weights.size
    if labels.size < count or int(quotas.sum()) != ancestors.size or ancestors.size < 1:
        raise ValueError(
            f"strata: a label for each of {count} weights and quotas that sum to {ancestors.size}, at least 1, are "
            f"needed, got {labels.size} and {quotas.tolist()}"
        )
    masses = np.zeros(quotas.size)
    labelled.masses(weights, labels, count, masses)
    if (quotas < 0).any() or (quotas[masses <= 0.0] > 0).any():
        raise ValueError(f"strata: quotas {quotas.tolist()} do not fit labels of weight {masses.tolist()}")
    schemes.within(weights, labels, quotas, masses, numbers(uniform, quotas.size), ancestors)
    return np.log(np.maximum(masses, 1e-300) / np.maximum(quotas, 1)).astype(np.float32)
