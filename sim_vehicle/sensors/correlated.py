"""Errors that wander: a first-order Gauss-Markov process (Ornstein-Uhlenbeck), exact for any step.

x(t + d) = a x(t) + sqrt(1 - a²) sigma w, with a = exp(-d / correlation) and w standard normal.
"""

from __future__ import annotations

import math

import numpy as np


class Wander:
    """One scalar error with a lasting standard deviation and a correlation time.

    Parameters
    ----------
    sigma : float
        Standard deviation at any one time.
    correlation : float
        Seconds after which its memory has fallen to 1/e.
    chance : numpy.random.Generator
        Where its steps come from; the first value is drawn at once.
    """

    def __init__(self, sigma: float, correlation: float, chance: np.random.Generator) -> None:
        self._sigma = sigma
        self._correlation = correlation
        self._chance = chance
        self._time = 0.0
        self.value = sigma * float(chance.standard_normal())

    def at(self, time: float) -> float:
        """Return the error at a time not before the last one asked for."""
        memory = math.exp(-max(0.0, time - self._time) / self._correlation)
        self._time = time
        fresh = math.sqrt(1.0 - memory * memory) * self._sigma * float(self._chance.standard_normal())
        self.value = memory * self.value + fresh
        return self.value
