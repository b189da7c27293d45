"""Annealed importance sampling with moves: from a density that can be drawn from to one that can only be evaluated.

A likelihood of many precise measurements is a needle: of thousands of points drawn from what was known before, none
may lie in it. So it is let in by degrees (Neal, "Annealed importance sampling", 2001; Del Moral, Doucet and Jasra,
"Sequential Monte Carlo samplers", 2006). The points pass through

    p_b(x)  ∝  start(x)^(1 - b) target(x)^b,        b from 0 to 1,

each step as long as leaves half of them effective (equation 4.36's measure). After a step the points are resampled,
and moved by Metropolis' rule, which leaves p_b as it is and makes copies differ again. A move goes along the difference
of two other points (ter Braak, "A Markov chain Monte Carlo version of the genetic algorithm differential evolution",
2006), so its size and direction are right whatever the shape, and it reaches from one hump to the other. The two
points come from the half that is not being moved, so the rule is exact.

The product of the steps' mean weights estimates the integral of the target: the evidence. Points drawn anew from it
are equally weighted. The work comes in pieces, for those who have a budget for each moment.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from filters.resampling import systematic

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
LogDensity = Callable[[Array], Array]
"""Logarithm of a density at points (n, dimension): (n,), minus infinity where it is zero, never NaN."""

EFFECTIVE = 0.5
"""Share of the points that must stay effective in one step."""

MOVES = 2
"""Times that every point tries to move after a step."""

MOST_STEPS = 200
"""Steps after which the target is taken whole, however few points stay effective."""

JITTER = 1e-3
"""Of the points' own spread: what is added to a move, so that it is not bound to the differences there are."""

LEAP = 0.1
"""Share of the moves that go the whole difference, from hump to hump."""


class AnnealedSampler:
    """Takes points from one density to another, a piece of work at a time.

    Parameters
    ----------
    points : (n, dimension) array
        Drawn from ``log_start``; at least 8.
    log_start : LogDensity
        Where they come from, normalised if the evidence is to be; finite at ``points``.
    log_target : LogDensity
        Where they go, up to a factor: the evidence estimates its integral.
    generator : numpy.random.Generator
        All the chance there is.
    wraps : sequence of int
        Dimensions that are angles: closed on themselves, radians in [-pi, pi).
    piece : int
        Most points that ``log_target`` is asked for at once.

    Attributes
    ----------
    points : (n, dimension) float64
        As they are now; samples of the target when :attr:`done`.
    log_evidence : float
        Logarithm of the target's integral, as far as it has come; minus infinity if no point has any of it.
    share : float
        How far it has come: b.
    done : bool
        Whether there is nothing left to do.

    Raises
    ------
    ValueError
        Fewer than 8 points, points that are not finite, or a piece below 1.
    """

    def __init__(
        self,
        points: ArrayLike,
        log_start: LogDensity,
        log_target: LogDensity,
        generator: np.random.Generator,
        wraps: Sequence[int] = (),
        piece: int = 1024,
    ) -> None:
        self.points: Array = np.array(points, np.float64)
        if self.points.ndim != 2 or len(self.points) < 8 or not np.isfinite(self.points).all():
            raise ValueError(
                f"annealed sampler: at least 8 finite points (n, dimension), got {self.points.shape}"
            )
        if piece < 1:
            raise ValueError(f"annealed sampler: a piece has at least 1 point, got {piece}")
        self.log_evidence = 0.0
        self.share = 0.0
        self.done = False
        self._log_start = log_start
        self._log_target = log_target
        self._generator = generator
        self._wraps = tuple(wraps)
        self._piece = piece
        self._start: Array = np.zeros(0)
        self._target: Array = np.zeros(0)
        self._steps = 0
        self._work = self._run()

    def advance(self) -> bool:
        """Do one piece of work; return whether all is done."""
        if not self.done and next(self._work, None) is None:
            self.done = True
        return self.done

    def finish(self) -> None:
        """Do all that is left."""
        while not self.advance():
            pass

    def _run(self) -> Iterator[bool]:
        count = len(self.points)
        self._start = self._log_start(self.points)
        self._target = np.empty(count)
        for part in self._parts(np.arange(count)):
            self._target[part] = self._log_target(self.points[part])
            yield True
        while self.share < 1.0:
            if not self._step():
                self.log_evidence = -math.inf
                return
            for _ in range(MOVES):
                order = self._generator.permutation(count)
                halves = order[: count // 2], order[count // 2 :]
                for moving, resting in (halves, halves[::-1]):
                    for part in self._parts(moving):
                        self._move(part, resting)
                        yield True

    def _parts(self, which: Indices) -> list[Indices]:
        return [which[first : first + self._piece] for first in range(0, which.size, self._piece)]

    def _step(self) -> bool:
        """Let in as much of the target as leaves enough points effective, and resample; False if none has any."""
        gain = self._target - self._start
        if not (gain > -math.inf).any():
            return False
        self._steps += 1
        step = 1.0 - self.share if self._steps > MOST_STEPS else _longest(gain, 1.0 - self.share)
        logs = step * gain
        top = float(logs.max())
        weights = np.exp(logs - top)
        self.log_evidence += top + math.log(float(weights.mean()))
        self.share = 1.0 if step >= 1.0 - self.share else self.share + step
        chosen = systematic(weights, weights.size, 1.0 - self._generator.random())
        self.points = self.points[chosen]
        self._start, self._target = self._start[chosen], self._target[chosen]
        return True

    def _move(self, which: Indices, others: Indices) -> None:
        generator, dimension = self._generator, self.points.shape[1]
        one = others[generator.integers(0, others.size, which.size)]
        other = others[generator.integers(0, others.size, which.size)]
        along = self._wrapped(self.points[one] - self.points[other])
        free = generator.random((which.size, dimension)) < generator.choice((0.4, 1.0), (which.size, 1))
        free[np.arange(which.size), generator.integers(0, dimension, which.size)] = True
        stride = 2.38 / np.sqrt(2.0 * free.sum(axis=1)) * generator.uniform(0.1, 1.0, which.size)
        stride[generator.random(which.size) < LEAP] = 1.0
        spread = JITTER * self.points.std(axis=0)
        along = stride[:, None] * along + spread * generator.standard_normal(along.shape)
        proposed = self._wrapped(self.points[which] + free * along)
        start, target = self._log_start(proposed), self._log_target(proposed)
        share = self.share
        with np.errstate(invalid="ignore"):
            ratio = share * (target - self._target[which])
            if share < 1.0:
                ratio += (1.0 - share) * (start - self._start[which])
        taken = np.log1p(-generator.random(which.size)) < ratio
        moved = which[taken]
        self.points[moved] = proposed[taken]
        self._start[moved], self._target[moved] = start[taken], target[taken]

    def _wrapped(self, points: Array) -> Array:
        for axis in self._wraps:
            points[:, axis] = np.remainder(points[:, axis] + math.pi, 2.0 * math.pi) - math.pi
        return points


def _longest(gain: Array, most: float) -> float:
    """Return the largest step, at most ``most``, whose weights exp(step · gain) leave enough points effective."""
    if _effective(most * gain) >= EFFECTIVE:
        return most
    low, high = 0.0, most
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _effective(middle * gain) >= EFFECTIVE else (low, middle)
    return max(low, 1e-9)


def _effective(logs: Array) -> float:
    """Share of the points that are effective under weights with these logarithms."""
    weights = np.exp(logs - logs.max())
    return float(weights.sum() ** 2 / (weights @ weights)) / weights.size
