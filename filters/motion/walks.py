"""The filter's walks of slow states: each pair of them shares its normals and walks in ticks of its own.

Line 4 of Table 4.3 for what nothing drives. A slow state is too slow to be worth random numbers at every tick, so
its motion is gathered until :data:`~filters.motion.slow.PERIOD` has passed, and the pairs are staggered, so that
no tick pays for all of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from filters.kernels import random
from filters.kernels.compile import Float32Array
from filters.motion.slow import PERIOD, RandomWalk, diffuse
from filters.particle_set import ParticleSet


class Walk:
    """One or two slow states that share a pair of normals, and the motion gathered since they last walked."""

    def __init__(
        self, walks: Sequence[RandomWalk], particles: ParticleSet, key: int, head_start: float
    ) -> None:
        self._rows = [(particles.row(walk.name), walk.walk) for walk in walks]
        self._key = key
        self._gathered = 0.0
        self._threshold = head_start
        self._sigma = 0.0

    def due(self, duration: float) -> bool:
        """Gather ``duration`` seconds; say whether it is time to walk, which starts the gathering anew."""
        self._gathered += duration
        if self._gathered < self._threshold:
            return False
        self._sigma = math.sqrt(self._gathered)
        self._gathered = 0.0
        self._threshold = PERIOD
        return self._sigma > 0.0

    def apply(self, particles: ParticleSet, first: int, last: int, noise: Float32Array, step: int) -> None:
        """Walk the particles ``first`` to ``last``; ``noise`` is overwritten, two rows of it."""
        random.normal_pairs(first, last, step, self._key, noise, 0)
        for noise_row, (row, walk) in enumerate(self._rows):
            diffuse(particles.columns, row, first, last, noise, noise_row, walk * self._sigma)


class Walks:
    """All slow states in pairs, which walk in different ticks.

    Parameters
    ----------
    walks : sequence of RandomWalk
        The slow states; those that do not move cost nothing.
    particles : ParticleSet
        Where their columns are.
    seed, stream : int
        Of the random numbers: the first pair draws from ``stream``, the next from the one after it.
    """

    def __init__(self, walks: Sequence[RandomWalk], particles: ParticleSet, seed: int, stream: int) -> None:
        moving = [walk for walk in walks if walk.walk > 0.0]
        pairs = [moving[i : i + 2] for i in range(0, len(moving), 2)]
        self._pairs = [
            Walk(pair, particles, random.key(seed, stream + i), PERIOD * (i + 1) / len(pairs))
            for i, pair in enumerate(pairs)
        ]

    def due(self, duration: float) -> list[Walk]:
        """Gather ``duration`` seconds; say which pairs walk now."""
        return [pair for pair in self._pairs if pair.due(duration)] if self._pairs else self._pairs
