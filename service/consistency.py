"""Whether a mean NEES is one that a consistent filter could have had.

The mean of n independent NEES of two dimensions, times n, is chi-square with 2 n degrees of freedom (Bar-Shalom, Li and
Kirubarajan, 2001, 5.4.2). The ticks of one run are anything but independent, so n is how many independent ones they are
worth: their number over the integrated autocorrelation time of the series (Geyer's initial positive sequence, 1992).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from filters import chi_square

PROBABILITY = 0.95
"""Of the interval."""

MOST = 5000
"""Independent samples beyond this many make the interval no narrower than the figure is worth."""


def independent(series: NDArray[np.float64]) -> float:
    """Return how many independent samples the correlated ``series`` (n,) is worth, 1…n."""
    count = len(series)
    if count < 4:
        return float(max(1, count))
    centred = series - series.mean()
    variance = float(np.mean(centred**2))
    if variance <= 0.0:
        return 1.0
    spectrum: NDArray[np.complex128] = np.fft.rfft(centred, 2 * count)
    correlation: NDArray[np.float64] = np.fft.irfft(spectrum * np.conj(spectrum))[:count] / (count * variance)
    pairs = correlation[: count - count % 2].reshape(-1, 2).sum(axis=1)
    negative = np.flatnonzero(pairs <= 0.0)
    time = 2.0 * float(pairs[: negative[0] if negative.size else len(pairs)].sum()) - 1.0
    return min(float(count), max(1.0, count / max(time, 1e-9)))


def bounds(samples: float) -> tuple[float, float]:
    """Return where the mean NEES of as many independent ``samples`` lies with :data:`PROBABILITY`."""
    degrees = 2 * max(1, min(MOST, round(samples)))
    tail = 0.5 * (1.0 - PROBABILITY)
    return (
        2.0 * chi_square.quantile(tail, degrees) / degrees,
        2.0 * chi_square.quantile(1.0 - tail, degrees) / degrees,
    )
