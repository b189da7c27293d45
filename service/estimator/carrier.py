"""A belief carried from the horizon to now: what comes of it, and what an output predictor must offer."""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from filters.belief import Displacement, Moments
from filters.density.gaussian import radius
from service.estimate import Triangle, Triple


class Pose(NamedTuple):
    """The belief at now.

    Attributes
    ----------
    moments : Moments
        Carried.
    covariance : (3, 3) float64
        Of north, east and heading, with what the way from the horizon adds.
    heading : tuple[float, float] or None
        Heading (rad) and its variance; ``None`` for what has none.
    down : tuple[float, float, float, float] or None
        Down (m), its variance, and its covariances with north and east (m²); ``None`` while unknown.
    velocity : Triple
        North, east, down, m/s.
    velocity_covariance : Triangle
        Its upper triangle, (m/s)².
    radius95 : float
        Metres about the mean that hold the vehicle with a probability of 95 %.
    """

    moments: Moments
    covariance: NDArray[np.float64]
    heading: tuple[float, float] | None
    down: tuple[float, float, float, float] | None
    velocity: Triple
    velocity_covariance: Triangle
    radius95: float

    def mean(self, name: str) -> float:
        """Return the mean of one column."""
        return float(self.moments.mean[self.moments.names.index(name)])

    def wider(self, added: NDArray[np.float64]) -> Pose:
        """Return it with the covariance of the place, (2, 2), larger by ``added``, and the radius with it."""
        own = radius(self.covariance[:2, :2], 0.95)
        covariance = self.covariance.copy()
        covariance[:2, :2] += added
        wider = radius(covariance[:2, :2], 0.95)
        if (
            self.radius95 > 1.01 * own
        ):  # that of several hypotheses is larger than the covariance would have it
            wider = math.sqrt(max(0.0, wider * wider - own * own + self.radius95 * self.radius95))
        return self._replace(covariance=covariance, radius95=wider)


class Carrier(Protocol):
    """Carries one belief's moments from its own time to now.

    Attributes
    ----------
    displacement : Displacement or None
        Of the last :meth:`at`; the cloud is carried by the same.
    """

    displacement: Displacement | None

    def at(self, belief_time: int, now: int) -> Pose:
        """Return the belief carried from ``belief_time`` to ``now`` (nanoseconds)."""
        ...
