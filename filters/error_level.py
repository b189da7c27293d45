"""How large the errors of a source usually are against a prediction that does not use it: learned, not believed.

A prediction with covariance P is compared with a measurement whose own claimed variance is r. If both were what they
say, the innovation would have the covariance P + r. Neither is: a process noise is set with caution, and receivers
claim what they like. So the innovation is taken to have

    S(k, m) = k P + r + m² I

where k says how cautious the prediction is and m is the level of the source's slow errors (multipath, a beacon's
bias). Both come from a grid, and a discrete Bayes filter (Table 4.1) learns which pair it is. Errors that stay alike
from one measurement to the next must not count twice: each adds its evidence times ``weight``, the share of an
independent measurement that it is worth.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from filters.discrete import DiscreteBayesFilter
from filters.kernels.error_level import log_likelihoods
from filters.kernels.testimony import hear_out
from filters.transition import Forgetting

Matrix = NDArray[np.float64]

CAUTIONS = (1.0, 0.25, 0.0625)
"""k: a prediction may be up to four times as good as it says, in standard deviations; it is never taken for worse."""

LEVELS = (1.0, 0.25, 0.0625)
"""m, as shares of the usual level."""

Expected = tuple[Matrix, Matrix, Matrix]


class Testimony(NamedTuple):
    """A reading beside what a Gaussian expects that has not heard of it.

    Attributes
    ----------
    residual : (n,) float64
        Measured minus what it expected.
    spread : (n, n) float64
        Covariance of what it expected.
    noise : (n,) float64
        Variances of the measurement, of one that repeats no other's errors.
    """

    residual: Matrix
    spread: Matrix
    noise: Matrix


class Opinion(NamedTuple):
    """What that Gaussian makes of it.

    Attributes
    ----------
    testimony : Testimony
        What it goes by.
    nis : float
        The squared residual in units of spread and noise.
    surprise : float
        By how many nats the residual is less likely than none, from an honest source; of the noise of several
        components the mean is taken.
    excuse : float
        Nats that the noise which the reading claims takes off any evidence. A liar's measurement lies anywhere. That an
        honest one lies at all near the prediction is the less surprising, by the logarithm of the standard deviation in
        each dimension, the wider it says that it may lie.
    """

    testimony: Testimony
    nis: float
    surprise: float
    excuse: float

    def information(self, nats: float) -> float:
        """Return what is left of ``nats`` of evidence; not below zero."""
        return max(0.0, nats - self.excuse)


class ErrorLevel:
    """What is normal for one source.

    Parameters
    ----------
    usual : float
        Level that an honest source may well have, in the measurement's unit. A source that has shown less is judged by
        it all the same: it may come into worse surroundings.
    forgetting : float
        Share by which what was learned goes back to the even prior with each independent measurement.

    Raises
    ------
    ValueError
        A level that is not positive, or a share outside [0, 1].
    """

    def __init__(self, usual: float, forgetting: float = 0.01) -> None:
        if not (0.0 < usual < math.inf and 0.0 <= forgetting <= 1.0):
            raise ValueError(
                f"error level: usual must be positive and forgetting in [0, 1], got {usual}, {forgetting}"
            )
        self.usual = usual
        self._forgetting = forgetting
        pairs = [(caution, usual * level) for caution in CAUTIONS for level in LEVELS]
        grid = np.array(pairs)
        self._cautions: Matrix = grid[:, 0].copy()
        self._variances: Matrix = np.square(grid[:, 1])
        self._floor = usual * usual
        self._filter = DiscreteBayesFilter[tuple[float, float]](pairs, np.eye(len(pairs)))

    @property
    def caution(self) -> float:
        """Expected k: by how much the covariance of the prediction is to be scaled to be what it turned out to be."""
        return float(self._filter.belief @ self._cautions)

    def hear_out(self, expected: Expected, covariance: Matrix, member: int, repeats: float) -> Opinion:
        """Return what a Gaussian makes of a reading.

        Parameters
        ----------
        expected : residual, jacobian, noise
            Of many Gaussians and one reading, as :class:`filters.linearised.bank.Expectations`.
        covariance : (B, d, d) float64
            Of all of them.
        member : int
            Which of them is asked.
        repeats : float
            How many readings share an independent error.
        """
        components = expected[0].shape[1]
        spread, claimed, said = np.empty((components, components)), np.empty(components), np.empty(3)
        hear_out.direct(
            covariance,
            *expected,
            self._filter.log_belief,
            self._cautions,
            self._floor,
            repeats,
            member,
            spread,
            claimed,
            said,
        )
        return Opinion(Testimony(expected[0][member], spread, claimed), *said.tolist())

    def learn(self, residual: Matrix, spread: Matrix, noise: Matrix, weight: float) -> None:
        """Learn from a residual of a source that is taken to be honest; it counts as ``weight`` measurements.

        Raises
        ------
        ValueError
            Numbers that are not finite; nothing was learned then.
        """
        logs = np.empty(self._cautions.size)
        log_likelihoods.direct(
            self._cautions,
            self._variances,
            _mean(noise),
            np.ascontiguousarray(residual, np.float64),
            np.ascontiguousarray(spread, np.float64),
            weight,
            logs,
        )
        if not np.isfinite(logs).all():
            raise ValueError(f"error level: finite numbers are needed, got residual {residual.tolist()}")
        self._filter.update_log(logs)
        self._filter.propagate(Forgetting(logs.size, weight * self._forgetting))


def _mean(values: Matrix) -> float:
    listed: list[float] = values.tolist()
    return sum(listed) / len(listed)
