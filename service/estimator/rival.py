"""A rival of the belief: what a search found, and how well it predicts since, beside the belief.

Both are asked to predict the measurements that come next. With L the ratio of the rival's evidence to the belief's over
all of these,

    P(L ever exceeds 1 / a) <= a        if the belief is right (Ville's inequality: L is then a martingale of mean 1)

so a rival that must reach 1 / a to win replaces a right belief with a probability of at most a per search, however long
it is watched. One outlier, or ten from anywhere, do not win: the rival must explain them one after the other.

That holds for outliers that come from anywhere. A thing that stands still and is in no map is no such outlier: there is
always a place from which it would be one of the landmarks, seen again and again. So a rival wins by landmarks without
names only if it would lead without the one that speaks the most for it, too.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from drivers.sample import SECOND
from filters.resampling import systematic
from filters.sensing import BearingMeasurement, RangeBearingMeasurement
from service.estimator.hearing import Heard
from service.estimator.measuring import Measurement
from service.estimator.way import Shape

Array = NDArray[np.float64]
Columns = dict[str, Array]

FALSE_ALARM = 1e-9
"""Probability with which one search replaces a belief that is right."""

LIKELY = 1e-3
"""Probability with which one search finds a place that seems to explain more than a belief that is right."""

LEAST_HEARD = 5
"""Absolute measurements that a rival must have explained before it may win."""

DISBELIEF = 0.5
"""Mean surprise of the belief at these from which it is wrong: a rival that is only a little better must wait."""

HOPELESS = -12.0
"""Logarithm of L below which a rival is given up."""

TRIAL = 10 * SECOND
"""After which it is given up anyhow."""


class Rival:
    """Weighted particles at one moment.

    Parameters
    ----------
    columns : mapping of str to (points,) float64
        By the name of the dimension.
    moment : int
        Their time, nanoseconds.

    Attributes
    ----------
    log_ratio : float
        Logarithm of L.
    heard : int
        Absolute measurements that both have predicted.
    surprise : float
        The belief's own surprise at these, summed.
    unnamed : list of (Heard, (points,) float64)
        Sights of landmarks without names, and by how much each point explains them better than the belief, in nats.
    """

    def __init__(self, columns: Mapping[str, Array], moment: int) -> None:
        self.columns = dict(columns)
        self.moment = moment
        self.log_ratio = 0.0
        self.heard = 0
        self.surprise = 0.0
        self.unnamed: list[tuple[Heard, Array]] = []
        self._log_weights: Array = np.zeros(len(next(iter(self.columns.values()))))

    def weigh(self, log_likelihood: Array, one: Heard) -> None:
        """Take one more measurement into the comparison."""
        before, after = self._log_weights, self._log_weights + log_likelihood
        self.log_ratio += _log_sum(after) - _log_sum(before) - max(one.log_mean, -1e3)
        self._log_weights = after
        if _unnamed(one.measured):
            self.unnamed.append((one, log_likelihood - max(one.log_mean, -1e3)))
        if one.measured.absolute:
            self.heard += 1
            self.surprise += one.surprise

    @property
    def wins(self) -> bool:
        """Whether it has explained enough, and the belief has not."""
        return self._explains(FALSE_ALARM)

    @property
    def leads(self) -> bool:
        """Whether it is likelier than the belief, if not so much so that it replaces that."""
        return self._explains(LIKELY)

    @property
    def likeliest(self) -> int:
        """Index of the likeliest point, so far."""
        return int(np.argmax(self._log_weights))

    def _explains(self, false_alarm: float) -> bool:
        return (
            self.heard >= LEAST_HEARD
            and self.surprise >= DISBELIEF * self.heard
            and self.log_ratio >= -math.log(false_alarm)
        )

    def apart(self, landmarks: Sequence[Hashable]) -> bool:
        """Say whether it leads without the landmark that speaks the most for it, too.

        Parameters
        ----------
        landmarks : sequence of hashable
            Which landmark each of the sights in :attr:`unnamed` fits best, seen from the likeliest point.
        """
        gains: dict[Hashable, float] = {}
        for landmark, (_, gain) in zip(landmarks, self.unnamed, strict=True):
            gains[landmark] = gains.get(landmark, 0.0) + float(gain[self.likeliest])
        return self.log_ratio - max(gains.values(), default=0.0) >= -math.log(LIKELY)

    def hopeless(self, time: int) -> bool:
        """Whether it has explained too little, or been on trial for too long, by ``time`` (nanoseconds)."""
        return self.log_ratio < HOPELESS or time - self.moment > TRIAL

    def draw(self, shape: Shape, count: int, generator: np.random.Generator) -> Columns:
        """Draw ``count`` particles by weight, carried along the way of which ``shape`` is to one time."""
        weights = np.exp(self._log_weights - self._log_weights.max())
        chosen = systematic(weights, count, 1.0 - generator.random())
        generator.shuffle(chosen)
        columns = {name: column[chosen] for name, column in self.columns.items()}
        poses = shape.poses(columns)
        blur, swing = math.sqrt(float(shape.variance[0])), math.sqrt(float(shape.turn_variance[0]))
        columns["north"] = poses.north[0] + blur * generator.standard_normal(count)
        columns["east"] = poses.east[0] + blur * generator.standard_normal(count)
        columns["heading"] = poses.heading[0] + swing * generator.standard_normal(count)
        return columns


def _unnamed(measured: Measurement) -> bool:
    """Say whether it is a sight of a landmark without a name."""
    value = measured.value
    return isinstance(value, RangeBearingMeasurement | BearingMeasurement) and value.north is None


def _log_sum(logs: Array) -> float:
    top = float(logs.max())
    return top + math.log(float(np.exp(logs - top).sum()))
