"""How late a receiver's fixes are beyond what is known of it: learned where the way bends or the speed changes.

Fixes that are δ late lie v δ behind the vehicle, whichever way it goes, and what is wrong with a receiver for a while
lies to one side of it. So odometry and gyro tell the two apart as soon as the vehicle has turned: each of a bank of
extended Kalman filters (:mod:`filters.linearised.bank`) has δ and the receiver's lasting error b as states beside the
pose, and own shares of the noises that were stated, as :mod:`filters.linearised.error_parts` has them::

    z = p(t - δ) + b + w,     w ~ N(0, r c² I),     c: the claim

δ is taken for a Gauss-Markov process of the variance that was stated, so that a vehicle that only ever goes straight
ahead knows no less of it than was said, and no more.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from filters.kalman import Matrix
from filters.linearised.bank import GaussianBank
from filters.motion.learned import SlowState
from filters.motion.slow import RandomWalk
from filters.motion.unicycle import Unicycle, UnicycleControl
from filters.sensing import Position, PositionMeasurement

LATENCY = "latency"
"""The state's name in the bank, for sensor models that have a delay."""

CHANGING = 600.0
"""Seconds for which a latency stays what it is."""

FRESH = ((1.0, 0.4), (0.25, 0.2), (0.0625, 0.2), (0.015625, 0.2))
"""Shares of the stated variance of a fix that are new every time, and their probabilities while nothing was heard."""

MOTION = ((1.0, 0.6), (0.1, 0.4))
"""Shares of the stated noise of the motion."""

GATE = 0.9999
"""What a Gaussian is sure to be an outlier it leaves out."""


class Late(NamedTuple):
    """By how much a receiver is late beyond what was said, seconds.

    Attributes
    ----------
    mean, sigma : float
        Of what is believed.
    """

    mean: float
    sigma: float


class Lateness:
    """What is known of one receiver's latency; begun anew as often as the belief is, and what was learned is kept.

    Parameters
    ----------
    motion : Unicycle
        Its noises are what is stated.
    slow : sequence of RandomWalk or Learned
        Slow states beside it.
    sigma : float
        How well the latency was known before anything was heard, seconds.
    duration : float
        Seconds for which the receiver's errors last.

    Attributes
    ----------
    bank : GaussianBank
        One member for each combination of shares; the latency and the error, north and east, come last.
    """

    def __init__(
        self, motion: Unicycle, slow: Sequence[SlowState], sigma: float, duration: float = 60.0
    ) -> None:
        table = [(fresh, share, p * q) for fresh, p in FRESH for share, q in MOTION]
        self._fresh, self._share, prior = np.array(table).T
        self._motion = motion
        self._sigma = sigma
        self._duration = duration
        self._log_belief: Matrix = np.log(prior)
        own = [RandomWalk(name, 0.0) for name in (LATENCY, "error/north", "error/east")]
        self.bank = GaussianBank(motion, [*slow, *own], len(table))
        self._row = self.bank.rows[LATENCY]
        self.late = Late(0.0, sigma)

    @property
    def live(self) -> bool:
        """Whether the Gaussians hold a belief."""
        return bool(self.bank.live[0])

    def mean(self) -> Matrix:
        """Return the mean of the mixture over all its states."""
        return np.exp(self._log_belief) @ self.bank.mean

    def begin(self, mean: Matrix, covariance: Matrix, claimed: float) -> None:
        """Have every Gaussian go on from a belief of all other states; of the error nothing is known but its claim.

        Parameters
        ----------
        mean, covariance : (d,), (d, d) float64
            Of the motion's and the slow states.
        claimed : float
            Variance of the part of the receiver's error that lasts, m².
        """
        size = mean.size
        all_means, all_covariances = np.zeros(size + 3), np.zeros((size + 3, size + 3))
        all_means[:size], all_covariances[:size, :size] = mean, covariance
        all_means[size] = self.late.mean
        np.fill_diagonal(all_covariances[size:, size:], (self.late.sigma**2, claimed, claimed))
        self.bank.set_all(all_means, all_covariances)

    def stop(self) -> None:
        """Have them hold nothing until :meth:`begin`."""
        self.bank.live[:] = False

    def predict(self, control: UnicycleControl | None, duration: float, claimed: float) -> None:
        """Let time pass, and an error of this variance (m²) become another one; ``None``: the vehicle stood."""
        if not self.live or duration <= 0.0:
            return
        if control is not None:
            own = control._replace(distance_sigma=0.0, turn_sigma=0.0)
            along, about = self._motion.noise_variances(own, duration)
            less = self._share - 1.0
            self.bank.predict(control, duration, less * along, less * about)
        self._fade(slice(self._row, self._row + 1), math.exp(-duration / CHANGING), self._sigma**2)
        self._fade(slice(self._row + 1, self._row + 3), math.exp(-duration / self._duration), claimed)

    def _fade(self, rows: slice, kept: float, variance: float) -> None:
        """Have states go back towards zero and their stationary variance (a Gauss-Markov process)."""
        mean, covariance = self.bank.mean, self.bank.covariance
        mean[:, rows] *= kept
        covariance[:, rows, :] *= kept
        covariance[:, :, rows] *= kept
        for row in range(rows.start, rows.stop):
            covariance[:, row, row] += (1.0 - kept * kept) * variance

    def hear(self, sensor: Position, value: PositionMeasurement, log_outlier: float, weight: float) -> None:
        """Learn from a fix, whose shares count as ``weight`` independent ones.

        Parameters
        ----------
        sensor : Position
            With :data:`LATENCY` for its delay.
        log_outlier : float
            Logarithm of the density of outliers.
        """
        if not self.live:
            return
        error = self._row + 1
        expected = self.bank.expect(sensor, value)
        expected.residual[:] -= self.bank.mean[:, error:]
        expected.jacobian[:, 0, error] = expected.jacobian[:, 1, error + 1] = 1.0
        expected.noise[:] *= self._fresh[:, None]
        said = self.bank.correct(expected, self.bank.live, GATE)
        logs = np.logaddexp(said.log_evidence, log_outlier)
        if weight > 0.0 and np.isfinite(logs).all():
            belief = self._log_belief + weight * logs
            self._log_belief = belief - np.logaddexp.reduce(belief)
        self._reckon()

    def witness(self, sensor: Any, value: Any) -> None:
        """Correct the Gaussians by a measurement of another sensor."""
        if self.live:
            self.bank.correct(self.bank.expect(sensor, value), self.bank.live, GATE)

    def _reckon(self) -> None:
        belief, row = np.exp(self._log_belief), self._row
        means = self.bank.mean[:, row]
        mean = float(belief @ means)
        variance = float(belief @ (self.bank.covariance[:, row, row] + (means - mean) ** 2))
        self.late = Late(mean, math.sqrt(variance))
