"""Slow states that a sensor learns by itself: given its path each particle has a mean, and all share a variance."""

from __future__ import annotations

from typing import NamedTuple

from filters.motion.slow import RandomWalk


class Learned(NamedTuple):
    """A slow state that is marginalised by the sensor model that it belongs to.

    Attributes
    ----------
    name : str
        Of its column, which holds the particles' means.
    walk : float
        Density of its walk, the state's unit per square root of a second.
    sigma : float
        What it may be at the start, beyond the spread of the particles' own values.
    """

    name: str
    walk: float
    sigma: float


SlowState = RandomWalk | Learned
