"""Where every particle was: the paths whose ends the particles are (*Probabilistic Robotics*, 4.3.3, eq. 4.30).

A particle is the end of a whole path x_0..t, and its weight is the product of the likelihoods along it (4.34). So a
measurement that arrives long after it was made needs no going back: every particle is weighed by where its own path
was then. What has to be kept are the poses at a few *marks*, and who descends from whom between two of them: one whole
number a particle, laid out with the copies whenever particles are resampled. Between two marks a path follows the way
that the controls tell; what the particle's own noise added to it is spread evenly over the time between (the mean of a
Brownian bridge).

Paths grow together backwards: after some resamplings many particles descend from few. The older a measurement is, the
less it can choose between, and the less it says: of a stretch as long as the particles take to coalesce, nothing. That
is the filter's own forgetting, and it errs on the careful side.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from filters.belief import Displacement
from filters.kernels.compile import Float32Array, Int32Array
from filters.particle import NOBODY, ParticleFilter
from filters.particle_set import ParticleSet

POSE = 3

Way = Callable[[int, int], Displacement]
"""The body's rigid motion between two times (nanoseconds), as the controls have it."""


class Past(NamedTuple):
    """The particles as they were, in the order of now, and whose path reaches back so far."""

    particles: ParticleSet
    known: NDArray[np.bool_]


class Paths:
    """The paths of a particle filter's particles, back to the oldest of a bounded number of marks.

    Memory: 16 bytes a particle and mark, allocated once.

    Parameters
    ----------
    belief : ParticleFilter
        Whose particles; it lays the lineage out from now on.
    marks : int
        How many poses of each particle are kept, at least 2.

    Raises
    ------
    ValueError
        Fewer than two marks.
    """

    def __init__(self, belief: ParticleFilter[Any], marks: int) -> None:
        if marks < 2:
            raise ValueError(f"paths: at least 2 marks are needed, got {marks}")
        self._belief = belief
        self._poses: Float32Array = np.zeros((marks, POSE, belief.capacity), np.float32)
        self._ancestors: Int32Array = np.zeros((marks, belief.capacity), np.int32)
        self._lineage: Int32Array = np.zeros(belief.capacity, np.int32)
        self._marked: list[tuple[int, int]] = []  # time and place in the ring, oldest first
        self._past = ParticleSet(belief.names, belief.capacity)
        belief.follow(self._lineage)

    @property
    def earliest(self) -> int | None:
        """Time of the oldest mark, nanoseconds: what is older cannot be weighed."""
        return self._marked[0][0] if self._marked else None

    @property
    def latest(self) -> int | None:
        """Time of the newest mark, nanoseconds."""
        return self._marked[-1][0] if self._marked else None

    def begin(self) -> None:
        """Forget all: the particles were drawn anew and descend from nobody."""
        self._marked.clear()

    def mark(self, time: int) -> None:
        """Keep every particle's pose, and who its ancestor at the last mark was; ``time`` is the belief's own."""
        count, marks = self._belief.count, len(self._poses)
        place = (self._marked[-1][1] + 1) % marks if self._marked else 0
        self._poses[place, :, :count] = self._belief.columns[:POSE, :count]
        self._ancestors[place, :count] = self._lineage[:count] if self._marked else NOBODY
        self._lineage[:count] = np.arange(count, dtype=np.int32)
        self._marked = [*self._marked[-(marks - 1) :], (time, place)]

    def at(self, time: int, now: int, way: Way) -> Past | None:
        """Return every particle as it was at ``time``; valid until the next call.

        Parameters
        ----------
        time : int
            Nanoseconds; not before the oldest mark.
        now : int
            The belief's time.
        way : Way
            What the controls say of the stretch about it.

        Returns
        -------
        Past or None
            The slow states are those of now. ``None`` where no mark is as old as that.
        """
        after = next(
            (index for index, (marked, _) in enumerate(self._marked) if marked > time), len(self._marked)
        )
        if after == 0:
            return None
        count = self._belief.count
        descent = self._lineage[:count].astype(np.intp)
        end, end_time = self._belief.columns[:POSE, :count], now
        for index in range(len(self._marked) - 1, after - 1, -1):
            end_time, place = self._marked[index]
            end = self._poses[place][:, descent]
            descent = np.where(descent == NOBODY, NOBODY, self._ancestors[place][descent])
        begin_time, place = self._marked[after - 1]
        self._between((begin_time, self._poses[place][:, descent]), time, (end_time, end), way)
        return Past(self._past, descent != NOBODY)

    def _between(
        self, begin: tuple[int, Float32Array], time: int, end: tuple[int, Float32Array], way: Way
    ) -> None:
        """Write the poses at ``time`` of paths through two poses each."""
        past, count = self._past, self._belief.count
        past.count = count
        past.columns[:, :count] = self._belief.columns[:, :count]
        past.variances = self._belief.particles.variances
        start = begin[1]
        then = _moved(start, way(begin[0], time))
        missed = end[1] - _moved(start, way(begin[0], end[0]))
        missed[2] = _wrapped(missed[2])
        share = np.float32((time - begin[0]) / max(1, end[0] - begin[0]))
        then += share * missed
        then[2] = _wrapped(then[2])
        past.columns[:POSE, :count] = then


def _moved(poses: Float32Array, way: Displacement) -> Float32Array:
    """Return poses (3, count), each moved along its own heading."""
    forward, right, turn = (np.float32(part) for part in way)
    sine, cosine = np.sin(poses[2]), np.cos(poses[2])
    return np.stack(
        [
            poses[0] + forward * cosine - right * sine,
            poses[1] + forward * sine + right * cosine,
            poses[2] + turn,
        ]
    )


def _wrapped(angles: Float32Array) -> Float32Array:
    """Return angles in [-pi, pi)."""
    turn = np.float32(2.0 * np.pi)
    return angles - turn * np.floor(angles / turn + np.float32(0.5))
