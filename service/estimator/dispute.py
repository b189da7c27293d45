"""What a receiver and the way disagree about, until it is decided who is right.

A receiver may be led away slowly, or stand in reflections for a minute, and claim centimetres all the same: the belief
follows it. Its witness (:class:`~service.estimator.witnesses.Witnesses`) knows where the vehicle would be without it.
Of two estimates of which one uses more than the other the difference d has at most the covariance S of the one that
uses less (Hausman, "Specification tests in econometrics", 1978), so ``q = d' S^-1 d`` is chi-square where both are
right. Where it is beyond that, one of them is wrong, and until the judge (:mod:`service.estimator.trust`) has decided
which,

- nobody knows where the vehicle is better than to d: published is ``(1 - T / q) (d d' + S)`` more,
- the receiver's fixes are weighed as ones whose errors last and are that large: the belief goes by the way.

The judge is patient, because reflections of 5 m are nobody's lie. This is what keeps the belief honest meanwhile.
"""

from __future__ import annotations

import math

import numpy as np

from drivers.sample import SECOND
from filters.kalman import Matrix
from filters.sensing import PositionMeasurement, VelocityMeasurement
from service.estimator.measuring import Measurement

USUAL = 9.2
"""T: in two dimensions q is larger once in a hundred times."""

LASTING = 60.0
"""Seconds for which a receiver's error stays alike."""

PACE = 10.0
"""Seconds in which a receiver may have gone as far away as it is disputed: so fast may its velocity lie."""

MEMORY = 120.0
"""Seconds after which a variance is down to 1 / e: a receiver that was off by so much may be so again, and a witness
that began since knows nothing of it."""

ALONE = 10.0
"""Seconds for which way and receiver must agree with each other and not with the belief before they are believed."""


class Dispute:
    """What is left of the disagreements of the last minutes.

    Attributes
    ----------
    held : (2, 2) float64
        As a covariance of the place, square metres.
    variance : float
        Of the belief, m² per axis: where it knows less than the receiver may be off by, it takes a fix for that.
    """

    def __init__(self) -> None:
        self.variance = 0.0
        self.held: Matrix = np.zeros((2, 2))
        self._heard: dict[str, int] = {}
        self._forsaken = 0.0

    def wait(self, seconds: float) -> None:
        """Let time pass."""
        self.held *= math.exp(-seconds / MEMORY)

    def settle(self) -> None:
        """Forget it: who was wrong has been decided."""
        self.held[:] = 0.0
        self._forsaken = 0.0

    def hear(self, away: Matrix, spread: Matrix) -> None:
        """Take a disagreement in, where it is larger than what is held.

        Parameters
        ----------
        away : (2,) float64
            Difference of two estimates, metres.
        spread : (2, 2) float64
            Covariance of the one that uses less, square metres.
        """
        square = float(away @ np.linalg.solve(spread, away))
        if square <= USUAL:
            return
        share = 1.0 - USUAL / square
        if share * float(away @ away) > float(np.trace(self.held)):
            self.held = share * (np.outer(away, away) + spread)

    def forsaken(self, away: Matrix, fix: Matrix, spread: Matrix, seconds: float) -> bool:
        """Say whether way and receiver have agreed for a while where the vehicle is, and that it is not there.

        Then it is the belief that is wrong, whoever led it there: to go on by the way would keep it wrong for ever.

        Parameters
        ----------
        away : (2,) float64
            Of the belief from what uses less, metres.
        fix : (2,) float64
            Of the receiver's fix from it, metres.
        spread : (2, 2) float64
            Covariance of both, square metres.
        seconds : float
            Since the fix before.
        """
        belief, receiver, between = (
            float(one @ np.linalg.solve(spread, one)) for one in (away, fix, away - fix)
        )
        wrong = receiver <= USUAL < min(belief, between)
        self._forsaken = self._forsaken + seconds if wrong else 0.0
        return self._forsaken >= ALONE

    def sized(self, time: int, measured: Measurement) -> Measurement:
        """Return a receiver's reading with the variance of one whose error lasts, as far as it is disputed."""
        value = measured.value
        if not isinstance(value, PositionMeasurement | VelocityMeasurement):
            return measured
        elapsed = min(1.0, max(0.01, (time - self._heard.get(measured.name, 0)) / SECOND))
        self._heard[measured.name] = time
        if not self.held.any():
            return measured
        lasting = 0.5 * float(np.trace(self.held))
        added = lasting * LASTING / elapsed
        if self.variance > lasting:
            added = min(added, lasting * self.variance / (self.variance - lasting))
        if isinstance(value, VelocityMeasurement):
            return measured._replace(value=value._replace(sigma=_wider(value.sigma, added / PACE**2)))
        north, east = _wider(value.sigma_north, added), _wider(value.sigma_east, added)
        return measured._replace(value=value._replace(sigma_north=north, sigma_east=east))


def _wider(sigma: float | None, added: float) -> float | None:
    """Return a standard deviation with a variance more; what the reading does not say the model knows."""
    return None if sigma is None else math.sqrt(sigma * sigma + added)
