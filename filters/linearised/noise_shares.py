"""Which share of its stated noise a motion, and a sensor, really has: learned by Gaussians that differ in it.

Whoever configures a vehicle states its noise with caution, or by a default that suits any gyro. A filter that believes
it is honest and useless: its region is many times as wide as its error. How large the noise is shows in how far the
measurements scatter about what was expected, so it is a parameter of the model like any other: a bank of extended
Kalman filters takes the same controls and measurements, each with its own share of the stated variances of turn and
distance, and Bayes' rule says which of them is right (multiple model estimation: Magill, "Optimal adaptive estimation
of sampled stochastic processes", IEEE Transactions on Automatic Control 10, 1965)::

    p(k | z_1..t)  ~  p(k | z_1..t-1) N(z_t; h(x_k), H C_k Hᵀ + r R)

A sensor's own share r is learned beside it, over a grid of its own, where its errors are said to be independent: where
not, an error that wanders slowly is not to pass for a small one. Were r left out, a sensor that scatters less than it
claims would make any motion look exact. Nothing lasts: every second a little of what was learned goes back to the
prior belief, whose mean is what was stated, and the Gaussians are mixed likewise
(:func:`filters.linearised.interacting.mix`), so that none is lost when tyres or surroundings change. The shares are
bounded on both sides.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from filters.kalman import Matrix
from filters.kernels import noise_shares as kernels
from filters.linearised.bank import Expectations, GaussianBank
from filters.linearised.interacting import mix
from filters.motion.learned import SlowState
from filters.motion.unicycle import Unicycle, UnicycleControl

TURN_SHARES = np.array((4.0, 1.0, 0.25, 0.0625, 0.015625, 0.00390625))
TURN_PRIOR = np.array((0.13, 0.4, 0.17, 0.1, 0.1, 0.1))
"""Of the turn's variance, and their probabilities while nothing was heard; the mean is one. A gyro may be half as good
as stated or sixteen times as good, in standard deviations."""

DISTANCE_SHARES = np.array((16.0, 4.0, 1.0, 0.25))
DISTANCE_PRIOR = np.array((0.01, 0.08, 0.46, 0.45))
"""The same of the distance: wheels may be twice as good as stated, or four times as bad; the best of them spin now and
then, and are believed until that has shown."""

SENSOR_SHARES = np.array((4.0, 1.0, 0.25, 0.0625, 0.015625))
SENSOR_PRIOR = np.array((0.1, 0.57, 0.11, 0.11, 0.11))
"""The same of a sensor's variance."""

FORGETTING = 0.002
SLIPPING = 0.01
"""Shares by which what was learned goes back to the prior belief with each second: of a gyro or another sensor, and of
wheels, which spin for a moment every minute or so."""

GATE = 0.9999
"""What a Gaussian is sure to be an outlier it leaves out."""


class SensorShare:
    """Which share of its stated variance the independent errors of one sensor have."""

    def __init__(self) -> None:
        self.log_belief: Matrix = np.log(SENSOR_PRIOR)
        self._expected: float | None = None

    @property
    def expected(self) -> float:
        """The mean share."""
        if self._expected is None:
            self._expected = float(np.exp(self.log_belief) @ SENSOR_SHARES)
        return self._expected

    def learned(self) -> None:
        """Note that the belief has become another one."""
        self._expected = None


class NoiseShares:
    """What is known of a motion's noise; begun anew as often as the belief is, and what was learned is kept.

    Parameters
    ----------
    motion : Unicycle
        Its noises are what is stated.
    slow : sequence of RandomWalk or Learned
        Slow states beside it.
    """

    def __init__(self, motion: Unicycle, slow: Sequence[SlowState] = ()) -> None:
        self._motion = motion
        self._prior: Matrix = np.outer(TURN_PRIOR, DISTANCE_PRIOR).ravel()
        self._log_belief: Matrix = np.log(self._prior)
        self._turning: Matrix = np.asarray(
            np.kron(_back(TURN_PRIOR, FORGETTING), _back(DISTANCE_PRIOR, SLIPPING)), np.float64
        )
        self._of_turn = np.repeat(TURN_SHARES, DISTANCE_SHARES.size)
        self._of_distance = np.tile(DISTANCE_SHARES, TURN_SHARES.size)
        self._of_both = np.column_stack((self._of_turn, self._of_distance))
        self.bank = GaussianBank(motion, slow, self._prior.size)
        self._table: Matrix = np.empty((self._prior.size, SENSOR_SHARES.size))

    @property
    def belief(self) -> Matrix:
        """Probabilities, (shares of the turn, shares of the distance)."""
        return np.exp(self._log_belief).reshape(TURN_SHARES.size, DISTANCE_SHARES.size)

    @property
    def live(self) -> bool:
        """Whether the Gaussians hold a belief."""
        return bool(self.bank.live[0])

    def begin(self, mean: Matrix, covariance: Matrix) -> None:
        """Have every Gaussian go on from this one."""
        self.bank.set_all(mean, covariance)

    def stop(self) -> None:
        """Have them hold nothing until :meth:`begin`."""
        self.bank.live[:] = False

    def predict(self, control: UnicycleControl, duration: float) -> None:
        """Move every Gaussian with its own share; what the control itself leaves open is shared by all."""
        if not self.live:
            return
        along, about = self._motion.noise_variances(UnicycleControl(control.distance, control.turn), duration)
        self.bank.predict(control, duration, (self._of_distance - 1.0) * along, (self._of_turn - 1.0) * about)

    def hear(
        self,
        sensor: Any,
        value: Any,
        log_outlier: float,
        weight: float,
        own: SensorShare | None = None,
        own_weight: float = 0.0,
    ) -> None:
        """Learn from a measurement, which counts as ``weight`` independent ones.

        Parameters
        ----------
        sensor, value
            A model that :data:`filters.linearised.bank.BATCHED` has, and its measurement.
        log_outlier : float
            Logarithm of the density of outliers.
        own : SensorShare, optional
            Of the sensor, if its errors are independent of each other; it learns, too, with ``own_weight``.
        """
        if not self.live:
            return
        expected = self.bank.expect(sensor, value)
        if own is None:
            logs = self.bank.correct(expected, self.bank.live, GATE).log_evidence
            kernels.learn_wandering.direct(logs, log_outlier, weight, DISTANCE_SHARES.size, self._log_belief)
            return
        scaled = Expectations(expected.residual, expected.jacobian, own.expected * expected.noise)
        kernels.log_densities.direct(self.bank.covariance, *expected, SENSOR_SHARES, log_outlier, self._table)
        if kernels.learn.direct(
            self._table,
            weight,
            self._log_belief,
            own.log_belief,
            own_weight,
            SENSOR_PRIOR,
            own_weight * FORGETTING,
        ):
            own.learned()
        self.bank.correct(scaled, self.bank.live, GATE)

    def pass_second(self) -> None:
        """Forget a second's worth, and mix the Gaussians."""
        if self.live:
            belief = np.exp(self._log_belief)
            mix(self.bank, self._turning, belief + 1e-12)
            self._log_belief = np.log(belief @ self._turning)

    def reckon(self) -> tuple[float, float]:
        """Return the mean shares of the stated variances of turn and distance."""
        turn, distance = (np.exp(self._log_belief) @ self._of_both).tolist()
        return turn, distance

    def mean(self) -> Matrix:
        """Return the mean of the mixture over the pose's north and east, (2,)."""
        return np.exp(self._log_belief) @ self.bank.mean[:, :2]


def _back(prior: Matrix, share: float) -> Matrix:
    """Return the transition by which a belief goes back to the prior one by a share."""
    return (1.0 - share) * np.eye(prior.size) + share * prior
