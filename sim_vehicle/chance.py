"""Random numbers, one independent stream for each part of the vehicle.

A stream is keyed by the seed and by the part's name alone, so a sensor that is switched off, or a new one,
leaves the noise of all the others as it was (Philox, a counter-based generator; Salmon et al., 2011).
"""

from __future__ import annotations

import hashlib

import numpy as np


def stream(seed: int, name: str) -> np.random.Generator:
    """Return the generator of one part.

    Parameters
    ----------
    seed : int
        Of the whole run, not negative.
    name : str
        Of the part, unique in the vehicle: ``wheels``, ``beacons``, ``mavlink``.

    Raises
    ------
    ValueError
        The seed is negative.
    """
    if seed < 0:
        raise ValueError(f"seed: needs a number of at least 0, got {seed}")
    words = np.frombuffer(hashlib.sha256(name.encode()).digest()[:16], dtype="<u4")
    return np.random.Generator(
        np.random.Philox(np.random.SeedSequence([seed, *(int(word) for word in words)]))
    )
