"""Line 4 of Table 4.1 in logarithms; see :mod:`filters.discrete`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from filters.kernels.compile import kernel

Float64Array = NDArray[np.float64]


@kernel("float64(float64[::1], float64[::1], float64[::1])", exact=True)
def weigh(log_belief: Float64Array, logs: Float64Array, weighed: Float64Array) -> float:
    """Write the normalised sum of both; return the logarithm of what it was divided by, NaN if there is no such thing.

    Minus infinity: all of them are impossible, and nothing sensible is written.
    """
    top = -math.inf
    for i in range(logs.size):
        weighed[i] = log_belief[i] + logs[i]
        if not logs[i] < math.inf:
            return math.nan
        top = max(top, weighed[i])
    if top == -math.inf:
        return top
    total = 0.0
    for i in range(logs.size):
        total += math.exp(weighed[i] - top)
    evidence = top + math.log(total)
    for i in range(logs.size):
        weighed[i] -= evidence
    return evidence
