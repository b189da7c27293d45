"""The lecture's resampling wheel, held against the multinomial distribution that it is taken for.

The weights stand around a wheel. A draw turns it on by a random angle, and takes the particle where it comes to rest::

    index = random index, beta = 0
    repeat:  beta += uniform(0, 2 max(w));  while beta > w[index]: beta -= w[index], index += 1;  take index

The chance to rest on a particle *is* its weight, once the start is forgotten. But two draws that follow each other lie
close together, unless twice the largest weight is a whole number of turns: only then is every draw independent of the
one before, and the copies are multinomial. Else they are not, as a chi-square of the whole draw shows: the wheel is
then nearer to a comb (Table 4.4), and varies less; and its first draw, which starts where a particle's stretch begins,
favours whoever comes first. Turned by uniform(0, Σ w), the wheel is multinomial whatever the weights are.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from filters.chi_square import cumulative
from filters.textbook.normal import Vector

Wheel = Callable[[ArrayLike, int, int, np.random.Generator], NDArray[np.int64]]

WEIGHTS = (0.4, 0.3, 0.2, 0.1)
BATCHES = 40_000


@dataclass(frozen=True)
class Comparison:
    """How a way to draw compares with the multinomial distribution, over many draws of as many as there are.

    Attributes
    ----------
    name : str
    expected, observed : (outcomes,) float64
        How often each outcome (copies of every particle) should occur by the multinomial, and did.
    copies : (n,) float64
        Copies of each particle, in the mean.
    variance_ratio : (n,) float64
        Variance of the copies over the multinomial's.
    chi_square : float
        Pearson's, of observed and expected.
    degrees : int
        Its degrees of freedom.
    probability : float
        Of a chi-square at least that large if the draw is multinomial.
    """

    name: str
    expected: Vector
    observed: Vector
    copies: Vector
    variance_ratio: Vector
    chi_square: float
    degrees: int
    probability: float


def lecture(
    weights: ArrayLike, count: int, batches: int, generator: np.random.Generator
) -> NDArray[np.int64]:
    """Draw by the wheel as the lecture has it, ``batches`` times over.

    Beta and index are kept as one position along the circumference, which is the same.

    Returns
    -------
    (batches, count) int64
        Ancestors.
    """
    weights = np.asarray(weights, np.float64)
    ends = np.cumsum(weights)
    starts = generator.integers(0, weights.size, (batches, 1))
    turns = generator.uniform(0.0, 2.0 * weights.max(), (batches, count))
    return resting(ends, (ends - weights)[starts], turns)


def whole_turns(
    weights: ArrayLike, count: int, batches: int, generator: np.random.Generator
) -> NDArray[np.int64]:
    """Draw by a wheel that is turned by up to a whole turn each time: independent draws."""
    ends = np.cumsum(np.asarray(weights, np.float64))
    turns = generator.uniform(0.0, ends[-1], (batches, count))
    return resting(ends, np.zeros((batches, 1)), turns)


def independent(
    weights: ArrayLike, count: int, batches: int, generator: np.random.Generator
) -> NDArray[np.int64]:
    """Draw by the definition: each particle on its own, with probability proportional to its weight."""
    ends = np.cumsum(np.asarray(weights, np.float64))
    return _particle(ends, generator.uniform(0.0, ends[-1], (batches, count)))


def resting(ends: Vector, start: Vector, turns: Vector) -> NDArray[np.int64]:
    """Say on which particle a wheel rests after each of its turns."""
    position = (start + np.cumsum(turns, axis=1)) % ends[-1]
    return _particle(ends, position)


def _particle(ends: Vector, position: Vector) -> NDArray[np.int64]:
    return np.asarray(np.searchsorted(ends, position, side="left"), np.int64)


WHEELS: dict[str, Wheel] = {
    "independent draws": independent,
    "wheel of the lecture": lecture,
    "wheel of whole turns": whole_turns,
}


def compare(
    name: str, weights: tuple[float, ...] = WEIGHTS, batches: int = BATCHES, seed: int = 5
) -> Comparison:
    """Count every outcome of drawing as many particles as there are, and compare with the multinomial."""
    share = np.array(weights) / np.sum(weights)
    size = share.size
    ancestors = WHEELS[name](share, size, batches, np.random.default_rng(seed))
    copies = np.stack([(ancestors == i).sum(axis=1) for i in range(size)], axis=1)
    outcomes = np.array([draw for draw in product(range(size + 1), repeat=size) if sum(draw) == size])
    seen = Counter(str(draw) for draw in copies.tolist())
    observed = np.array([seen[str(draw)] for draw in outcomes.tolist()], np.float64)
    expected = batches * np.array([_multinomial(draw, share) for draw in outcomes.tolist()])
    chi_square = float(np.sum((observed - expected) ** 2 / expected))
    degrees = len(outcomes) - 1
    return Comparison(
        name,
        expected,
        observed,
        copies.mean(axis=0),
        copies.var(axis=0) / (size * share * (1.0 - share)),
        chi_square,
        degrees,
        1.0 - cumulative(chi_square, degrees),
    )


def sweep(
    name: str, largest: ArrayLike, size: int = 4, batches: int = BATCHES, seed: int = 6
) -> NDArray[np.float64]:
    """Chi-square per degree of freedom where one of ``size`` particles has the given weight, the rest equal ones."""
    results = [
        compare(name, (weight, *[(1.0 - weight) / (size - 1)] * (size - 1)), batches, seed)
        for weight in np.asarray(largest, np.float64).tolist()
    ]
    return np.array([result.chi_square / result.degrees for result in results])


def _multinomial(draw: list[int], share: Vector) -> float:
    ways = math.factorial(sum(draw)) / math.prod(math.factorial(copies) for copies in draw)
    return ways * math.prod(float(p) ** copies for p, copies in zip(share, draw, strict=True))
