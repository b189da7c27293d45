"""The outlier part that every sensor model has: a fraction of the measurements says nothing about the state.

    p(z | x) = (1 - outliers) N(z; expected, sigma²) + outliers / span

A belief weighed so never loses a particle to one bad reading: the log likelihood is bounded from below.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

NEVER = -3e38
"""Logarithm of an outlier part that does not exist, as a float32."""


class Mixture(NamedTuple):
    """Log densities of the two parts at the inlier's peak, relative to their sum, and that of the sum."""

    log_inlier: float
    log_outlier: float
    log_peak: float


@lru_cache(maxsize=1024)
def mixture(outliers: float, log_inlier_density: float, log_outlier_density: float) -> Mixture:
    """Mix an inlier density, given at its peak, with a uniform one."""
    if outliers == 0.0:
        return Mixture(0.0, NEVER, log_inlier_density)
    inlier = math.log1p(-outliers) + log_inlier_density
    outlier = math.log(outliers) + log_outlier_density
    peak = max(inlier, outlier) + math.log1p(math.exp(-abs(inlier - outlier)))
    return Mixture(inlier - peak, outlier - peak, peak)


def check(sensor: str, sigma: float, outliers: float, span: float) -> None:
    """Check the parameters that all sensors have.

    Raises
    ------
    ValueError
        ``sigma`` or ``span`` not positive and finite, ``outliers`` not in [0, 1).
    """
    if not 0.0 < sigma < math.inf:
        raise ValueError(f"{sensor}: sigma must be positive and finite, got {sigma}")
    if not 0.0 < span < math.inf:
        raise ValueError(f"{sensor}: span must be positive and finite, got {span}")
    if not 0.0 <= outliers < 1.0:
        raise ValueError(f"{sensor}: outliers is a fraction in [0, 1), got {outliers}")


def sigma_refusal(sigma: float | None) -> str | None:
    """Why a measurement's own sigma cannot be used."""
    return f"sigma must be positive, got {sigma}" if sigma is not None and sigma <= 0.0 else None
