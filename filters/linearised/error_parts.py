"""What a receiver's errors are made of: how large the part that lasts is, for how long, and what is new every time.

A receiver claims one standard deviation. Of it :mod:`filters.sensing.biased_position` wants three numbers: the variance
of the part that lasts and the time for which it does, and the variance of what does not. They show in how the fixes
differ from the way that odometry tells: from second to second in what is new, over minutes in what lasts. So a bank of
extended Kalman filters goes along, with the receiver's error as two more states, each with its own three numbers and
its own shares of the stated noise of turn and distance, and Bayes' rule says which of them is right (multiple model
estimation: Magill, "Optimal adaptive estimation of sampled stochastic processes", IEEE Transactions on Automatic
Control 10, 1965; as :mod:`filters.linearised.noise_shares` has it for the motion alone)::

    p(k | z_1..t)  ~  p(k | z_1..t-1) N(z_t; h(x_k) + b_k, H C_k Hᵀ + w_k c² I),     c: the claim

The two must be learned together: an error that wanders passes for a vehicle that does, and the other way round. Nothing
lasts: with every second a little of what was learned goes back to the prior belief.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from filters.kalman import Matrix
from filters.kernels import noise_shares as kernels
from filters.linearised.bank import Expectations, GaussianBank
from filters.linearised.noise_shares import SENSOR_PRIOR, SENSOR_SHARES, SensorShare
from filters.motion.learned import SlowState
from filters.motion.slow import RandomWalk
from filters.motion.unicycle import Unicycle, UnicycleControl
from filters.sensing import Position, PositionMeasurement

FRESH = ((0.4, 0.35), (0.06, 0.3), (0.01, 0.2), (0.0015, 0.15))
"""Shares of the claimed variance that are new every second, and their probabilities while nothing was heard. A receiver
in reflections of metres has centimetres that are new: taken for more, they would make all else look smaller."""

LASTING = (
    ((0.25, 60.0), 0.15),
    ((1.0, 30.0), 0.2),
    ((1.0, 100.0), 0.2),
    ((1.0, 400.0), 0.17),
    ((1.0, 1500.0), 0.12),
    ((4.0, 30.0), 0.05),
    ((4.0, 100.0), 0.06),
    ((4.0, 400.0), 0.05),
)
"""Shares that last, and seconds for which they do: reflections for less than a minute or some, the atmosphere for
longer. Receivers are half to twice as good as they claim."""

TURN = ((4.0, 0.1), (1.0, 0.5), (0.1, 0.2), (0.01, 0.2))
DISTANCE = ((4.0, 0.1), (1.0, 0.5), (0.25, 0.4))
"""Shares of the stated variances of turn and distance: they are stated with caution, or by a default that suits any
gyro, and their mean is about what was stated."""

FORGETTING = 0.002
SLIPPING = 0.01
"""Shares by which what was learned goes back to the prior belief with each second: of error and gyro, and of wheels,
which spin for a moment every minute or so."""

GATE = 0.9999
"""What a Gaussian is sure to be an outlier it leaves out."""


class Parts(NamedTuple):
    """What a receiver's error is made of, as shares of the variance that it claims.

    Attributes
    ----------
    fresh, lasting : float
        What is new every time, and what lasts.
    duration : float
        Seconds for which it does.
    """

    fresh: float
    lasting: float
    duration: float


class ErrorParts:
    """What is known of one receiver's errors; begun anew as often as the belief is, and what was learned is kept.

    Parameters
    ----------
    motion : Unicycle
        Its noises are what is stated.
    slow : sequence of RandomWalk or Learned
        Slow states beside it.

    Attributes
    ----------
    bank : GaussianBank
        One member for each combination; the error, north and east, comes after all other states.
    """

    def __init__(self, motion: Unicycle, slow: Sequence[SlowState] = ()) -> None:
        table = [
            (fresh, lasting, duration, turn, distance)
            for fresh, _ in FRESH
            for (lasting, duration), _ in LASTING
            for turn, _ in TURN
            for distance, _ in DISTANCE
        ]
        fresh, lasting, duration, turn, distance = np.array(table).T
        self._motion = motion
        self._fresh, self._lasting, self._rate = fresh, lasting, 1.0 / duration
        self._turn, self._distance = turn, distance
        error: Matrix = np.outer(_probabilities(FRESH), _probabilities(LASTING)).ravel()
        self._priors = (error, _probabilities(TURN), _probabilities(DISTANCE))
        self._log_belief: Matrix = np.log(np.einsum("i,j,k->ijk", *self._priors).ravel())
        self.bank = GaussianBank(
            motion, [*slow, RandomWalk("error/north", 0.0), RandomWalk("error/east", 0.0)], len(table)
        )
        self._error = len(self.bank.names) - 2
        self._table: Matrix = np.empty((len(table), SENSOR_SHARES.size))

    @property
    def live(self) -> bool:
        """Whether the Gaussians hold a belief."""
        return bool(self.bank.live[0])

    @property
    def parts(self) -> Parts:
        """The mean shares, and the time for which the variance would grow at first as it does on average."""
        belief = np.exp(self._log_belief)
        lasting = float(belief @ self._lasting)
        return Parts(
            float(belief @ self._fresh), lasting, lasting / float(belief @ (self._lasting * self._rate))
        )

    @property
    def motion_shares(self) -> tuple[float, float]:
        """The mean shares of the stated variances of turn and distance."""
        belief = np.exp(self._log_belief)
        return float(belief @ self._turn), float(belief @ self._distance)

    @property
    def knowledge(self) -> Matrix:
        """What was learned: log probabilities of the members; may be set to what it was before."""
        return self._log_belief.copy()

    @knowledge.setter
    def knowledge(self, log_belief: Matrix) -> None:
        self._log_belief = log_belief.copy()

    def mean(self) -> Matrix:
        """Return the mean of the mixture over all its states."""
        return np.exp(self._log_belief) @ self.bank.mean

    def begin(self, mean: Matrix, covariance: Matrix) -> None:
        """Have every Gaussian go on from this one, the receiver's error its last two dimensions."""
        self.bank.set_all(mean, covariance)

    def stop(self) -> None:
        """Have them hold nothing until :meth:`begin`."""
        self.bank.live[:] = False

    def predict(self, control: UnicycleControl | None, duration: float, claim: float) -> None:
        """Let time pass, and the error of a receiver of this claim (m) become another; ``None``: the vehicle stood."""
        if not self.live or duration <= 0.0:
            return
        if control is not None:
            own = control._replace(distance_sigma=0.0, turn_sigma=0.0)
            along, about = self._motion.noise_variances(own, duration)
            self.bank.predict(control, duration, (self._distance - 1.0) * along, (self._turn - 1.0) * about)
        kept = np.exp(-duration * self._rate)
        added = (1.0 - kept * kept) * self._lasting * (claim * claim)
        mean, covariance, error = self.bank.mean, self.bank.covariance, self._error
        mean[:, error:] *= kept[:, None]
        covariance[:, error:, :] *= kept[:, None, None]
        covariance[:, :, error:] *= kept[:, None, None]
        for row in (error, error + 1):
            covariance[:, row, row] += added

    def hear(
        self, sensor: Position, value: PositionMeasurement, variance: float, log_outlier: float, weight: float
    ) -> None:
        """Learn from a fix, which counts as ``weight`` independent ones.

        Parameters
        ----------
        variance : float
            That it claims, of which the shares are taken, m²; with what several fixes have in common.
        log_outlier : float
            Logarithm of the density of outliers.
        """
        if not self.live:
            return
        error = self._error
        expected = self.bank.expect(sensor, value)
        expected.residual[:] -= self.bank.mean[:, error:]
        expected.jacobian[:, 0, error] = expected.jacobian[:, 1, error + 1] = 1.0
        expected.noise[:] = (self._fresh * variance)[:, None]
        said = self.bank.correct(expected, self.bank.live, GATE)
        logs = np.logaddexp(said.log_evidence, log_outlier)
        if weight > 0.0 and np.isfinite(logs).all():
            belief = self._log_belief + weight * logs
            self._log_belief = belief - np.logaddexp.reduce(belief)

    def witness(
        self,
        sensor: Any,
        value: Any,
        log_outlier: float = -math.inf,
        weight: float = 0.0,
        own: SensorShare | None = None,
    ) -> None:
        """Correct the Gaussians by a measurement of another sensor, and learn from it as :meth:`hear` does.

        Parameters
        ----------
        own : SensorShare, optional
            Which share of its variance it has; it learns, too. Without it, nothing is learned.
        """
        if not self.live:
            return
        expected = self.bank.expect(sensor, value)
        if own is not None and weight > 0.0:
            kernels.log_densities.direct(
                self.bank.covariance, *expected, SENSOR_SHARES, log_outlier, self._table
            )
            noise = own.expected * expected.noise
            if kernels.learn.direct(
                self._table,
                weight,
                self._log_belief,
                own.log_belief,
                weight,
                SENSOR_PRIOR,
                weight * FORGETTING,
            ):
                own.learned()
            expected = Expectations(expected.residual, expected.jacobian, noise)
        self.bank.correct(expected, self.bank.live, GATE)

    def forget(self, seconds: float) -> None:
        """Let a little of what was learned go back to the prior belief, of each by itself."""
        belief = np.exp(self._log_belief).reshape([prior.size for prior in self._priors])
        for axis, (prior, rate) in enumerate(
            zip(self._priors, (FORGETTING, FORGETTING, SLIPPING), strict=True)
        ):
            kept = math.exp(-rate * seconds)
            shape = [1, 1, 1]
            shape[axis] = prior.size
            belief = kept * belief + (1.0 - kept) * belief.sum(axis, keepdims=True) * prior.reshape(shape)
        self._log_belief = np.log(belief.ravel())


def _probabilities(of: Sequence[tuple[Any, float]]) -> Matrix:
    """Return the probabilities of a table's rows, which sum to one."""
    given = np.array([probability for _, probability in of])
    return given / given.sum()
