"""Figure 4.7: the principle of low-variance resampling, Table 4.4.

The weights are laid end to end. A comb of M equally spaced teeth, shifted by one random number r in (0, 1/M], is laid
over them; every tooth u = r + (m - 1)/M chooses the particle whose weight it falls on (equation 4.37):

    i = argmin over j of  Σ_{m=1..j} w[m] ≥ u
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from filters.resampling import systematic

WEIGHTS = (0.05, 0.17, 0.02, 0.28, 0.12, 0.03, 0.24, 0.09)


@dataclass(frozen=True)
class Comb:
    """The draw, tooth by tooth.

    Attributes
    ----------
    weights : (n,) float64
        Normalised.
    ends : (n,) float64
        Cumulative weights: where each particle's stretch ends.
    offset : float
        r.
    teeth : (count,) float64
        u.
    ancestors : (count,) int32
        Which particle each tooth chose, by :func:`filters.resampling.systematic`.
    copies : (n,) int64
        How often each particle was chosen.
    """

    weights: NDArray[np.float64]
    ends: NDArray[np.float64]
    offset: float
    teeth: NDArray[np.float64]
    ancestors: NDArray[np.int32]
    copies: NDArray[np.int64]


def comb(uniform: float = 0.62, weights: tuple[float, ...] = WEIGHTS) -> Comb:
    """Draw as many particles as there are, with the random number ``uniform`` = r M in (0, 1]."""
    share = np.array(weights) / np.sum(weights)
    count = share.size
    ancestors = systematic(share.astype(np.float32), count, uniform)
    teeth = (uniform + np.arange(count, dtype=np.float64)) / count
    copies = np.bincount(ancestors, minlength=count)
    return Comb(share, np.cumsum(share), uniform / count, teeth, ancestors, copies)
