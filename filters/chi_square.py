"""Chi-square: what a normalised innovation squared is, if the filter's model is right; its quantiles make gates.

The cumulative probability is the regularised incomplete gamma function P(k/2, x/2), by its power series (Abramowitz
and Stegun, 6.5.29), whose terms are all positive; the quantile inverts it by bisection.
"""

from __future__ import annotations

import math
from functools import lru_cache

_ITERATIONS = 200


def cumulative(value: float, degrees: int) -> float:
    """Probability that a chi-square number of ``degrees`` degrees of freedom is at most ``value``.

    Raises
    ------
    ValueError
        Degrees below 1, or a value that is NaN.
    """
    if degrees < 1 or math.isnan(value):
        raise ValueError(
            f"chi-square: degrees of at least 1 and a number are needed, got {degrees} and {value}"
        )
    if value <= 0.0:
        return 0.0
    shape, x = 0.5 * degrees, 0.5 * value
    if x > shape + 60.0 + 12.0 * math.sqrt(shape):
        return 1.0  # what is left is below 1e-16
    term = math.exp(shape * math.log(x) - x - math.lgamma(shape + 1.0))
    total, k = term, 0
    while term > 1e-17 * total:
        k += 1
        term *= x / (shape + k)
        total += term
    return min(total, 1.0)


@lru_cache(maxsize=256)
def quantile(probability: float, degrees: int) -> float:
    """Value that a chi-square number of ``degrees`` degrees of freedom stays below with ``probability``.

    Raises
    ------
    ValueError
        A probability outside (0, 1), or degrees below 1.
    """
    if not 0.0 < probability < 1.0:
        raise ValueError(f"chi-square: probability must lie in (0, 1), got {probability}")
    low, high = 0.0, float(degrees)
    while cumulative(high, degrees) < probability:
        low, high = high, 2.0 * high
    for _ in range(_ITERATIONS):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        low, high = (middle, high) if cumulative(middle, degrees) < probability else (low, middle)
    return high
