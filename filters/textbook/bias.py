"""The bias of a particle filter with few particles: equation 4.38 and exercise 3, computed exactly.

With one particle, resampling takes it whatever its weight: w / w = 1. The measurement has no say, and the filter holds
p(x_t | u_1..t) instead of p(x_t | u_1..t, z_1..t). With two the measurement has a say only between the two that were
drawn. In general a weight is normalised by the sum of M random ones, and the mean of a ratio is not the ratio of
the means: for two states of prior p and 1 - p, with likelihoods a and b and two particles,

    E[share of state 1] = p² + 2 p (1 - p) a / (a + b),     while Bayes says   p a / (p a + (1 - p) b)

On a finite state space the particles' joint distribution is an array with one axis per particle, so Table 4.3 can be
carried out on the distribution itself instead of on draws, over any number of steps: exact, and the oracle of
:func:`simulated`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from filters.resampling import multinomial

Array = NDArray[np.float64]

MOST = 100_000
"""Largest number of joint states, states to the power of particles, that is enumerated for one step."""

MOST_FOR_MORE = 3_000
"""The same where another step follows: each joint state then leads to all of them."""


class Step(NamedTuple):
    """One step of Table 4.3.

    Attributes
    ----------
    transition : (n, n) float64
        p(x_t = column | u_t, x_{t-1} = row); rows sum to one.
    likelihood : (n,) float64
        p(z_t | x_t), up to a factor.
    """

    transition: Array
    likelihood: Array


def posterior(prior: ArrayLike, steps: Sequence[Step]) -> Array:
    """Return what the filter is meant to hold, (n,): the Bayes filter of Table 4.1."""
    belief = _checked(prior, steps)
    for step in steps:
        belief = (belief @ step.transition) * step.likelihood
        belief = belief / belief.sum()
    return belief


def expected(prior: ArrayLike, steps: Sequence[Step], particles: int) -> Array:
    """Return the mean share of particles in each state after the steps, (n,): exactly, by enumeration.

    Every step moves each particle, weighs it and resamples independently (Table 4.3).

    Raises
    ------
    ValueError
        No particles, more joint states than can be enumerated, or probabilities that are none.
    """
    start = _checked(prior, steps)
    size = start.size
    most = MOST if len(steps) <= 1 else MOST_FOR_MORE
    if particles < 1 or size**particles > most:
        raise ValueError(
            f"bias: {particles} particles of {size} states make {size}^{particles} joint states; over {len(steps)} "
            f"steps, 1 to {most} can be enumerated"
        )
    joint = np.array(1.0)
    for _ in range(particles):
        joint = np.multiply.outer(joint, start)
    for step in steps[:-1]:
        joint = _resampled(_moved(joint, step.transition), step.likelihood)
    if not steps:
        return start
    mean = np.zeros(size)
    for chance, share in _shares(_moved(joint, steps[-1].transition), steps[-1].likelihood):
        mean += chance * share
    return mean


def simulated(prior: ArrayLike, steps: Sequence[Step], particles: int, runs: int, seed: int) -> Array:
    """Return the same share from so many runs of the filter, (n,), with this library's multinomial resampling.

    Raises
    ------
    ValueError
        No particles or no runs, or probabilities that are none.
    """
    start = _checked(prior, steps)
    if particles < 1 or runs < 1:
        raise ValueError(f"bias: at least one particle and one run, got {particles} and {runs}")
    generator = np.random.default_rng(seed)
    shape = (runs, particles)
    states = np.searchsorted(np.cumsum(start)[:-1], generator.random(shape), side="right")
    for step in steps:
        cumulative = np.cumsum(step.transition, axis=1)[:, :-1]
        states = (generator.random(shape)[..., None] >= cumulative[states]).sum(axis=-1)
        weights = step.likelihood[states].astype(np.float32)
        weights[weights.max(axis=1) <= 0.0] = 1.0  # as ParticleFilter.normalize does
        uniforms = 1.0 - generator.random(runs)
        for run in range(runs):
            states[run] = states[run, multinomial(weights[run], particles, uniforms[run])]
    return np.bincount(states.ravel(), minlength=start.size) / states.size


def _moved(joint: Array, transition: Array) -> Array:
    """Line 4 on the joint distribution: each particle moves by itself."""
    for axis in range(joint.ndim):
        joint = np.moveaxis(np.tensordot(joint, transition, axes=(axis, 0)), -1, axis)
    return joint


def _shares(joint: Array, likelihood: Array) -> Iterator[tuple[float, Array]]:
    """Line 5: every joint state that can be, its probability, and the share of weight in each state."""
    particles, size = joint.ndim, joint.shape[0]
    for states in product(range(size), repeat=particles):
        chance = float(joint[states])
        if chance > 0.0:
            weights = likelihood[list(states)]
            if weights.sum() == 0.0:  # as ParticleFilter.normalize does
                weights = np.ones(particles)
            yield chance, np.bincount(states, weights=weights, minlength=size) / weights.sum()


def _resampled(joint: Array, likelihood: Array) -> Array:
    """Lines 8 to 11: given the moved particles, each new one is drawn independently."""
    after = np.zeros_like(joint)
    for chance, share in _shares(joint, likelihood):
        independent = np.array(chance)
        for _ in range(joint.ndim):
            independent = np.multiply.outer(independent, share)
        after += independent
    return after


def _checked(prior: ArrayLike, steps: Sequence[Step]) -> Array:
    start = np.asarray(prior, np.float64)
    if start.ndim != 1 or not _distribution(start):
        raise ValueError(f"bias: the prior must be (n,) probabilities that sum to one, got {prior}")
    for number, step in enumerate(steps, 1):
        if step.transition.shape != (start.size, start.size) or not _distribution(step.transition):
            raise ValueError(
                f"bias: step {number}: transition must be {start.size} rows of as many probabilities"
            )
        if (
            step.likelihood.shape != start.shape
            or not (np.isfinite(step.likelihood) & (step.likelihood >= 0)).all()
        ):
            raise ValueError(
                f"bias: step {number}: likelihood must be {start.size} finite numbers, none negative"
            )
    return start


def _distribution(rows: Array) -> bool:
    return bool(np.isfinite(rows).all() and (rows >= 0.0).all() and np.allclose(rows.sum(axis=-1), 1.0))
