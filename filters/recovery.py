"""Augmented recovery: notice from the evidence that the belief is wrong, and say how much of it to draw anew.

A belief that holds no particle near the truth cannot find back by itself (particle deprivation, section 4.3.4). That
it is lost shows in how well it expects what is measured: the mean likelihood of a measurement over the particles,
*unnormalised*. Two running averages of it, a slow and a fast one, tell a belief that suddenly fails from a sensor that
is always poor (Gutmann and Fox 2002; Augmented_MCL, Table 8.3)::

    w_slow += a_slow (w - w_slow),   w_fast += a_fast (w - w_fast)
    share to draw anew = max(0, 1 - w_fast / w_slow)

Normalised weights have the mean 1 / M whatever happens, so recovery that is fed with them never fires.

Likelihoods of many measurements underflow, and differ between sensors by units and by factors of thousands. So the
averages are kept as logarithms, each kind of sensor has its own pair, and a reading's evidence is counted relative to
what such a reading would have if the belief were right (:func:`expected_log_evidence`): a reading with ten times the
sigma is not taken for a failure. The share is the mean of what each kind asks for, so one faulty sensor of four never
asks for more than a quarter. What to draw instead: :mod:`filters.proposals`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable


class Averages:
    """A slow and a fast running average of the same positive numbers, as logarithms.

    The first positive number is what both begin with; before it nothing is known and the share is 0.

    Parameters
    ----------
    slow, fast : float
        Weight of a new number in each, 0 < slow < fast <= 1: about one over the numbers that it remembers.

    Raises
    ------
    ValueError
        Rates out of order or of range.
    """

    def __init__(self, slow: float, fast: float) -> None:
        if not 0.0 < slow < fast <= 1.0:
            raise ValueError(f"averages: 0 < slow < fast <= 1 is needed, got {slow} and {fast}")
        self._slow_rate = slow
        self._fast_rate = fast
        self.log_slow = -math.inf
        self.log_fast = -math.inf

    def add(self, log_number: float) -> None:
        """Take one number by its logarithm; minus infinity for zero.

        Raises
        ------
        ValueError
            NaN or plus infinity; the averages are as they were.
        """
        if not log_number < math.inf:
            raise ValueError(f"averages: the log of a number must be finite or -inf, got {log_number}")
        if self.log_slow == -math.inf:
            self.log_slow = self.log_fast = log_number
            return
        self.log_slow = _blend(self.log_slow, log_number, self._slow_rate)
        self.log_fast = _blend(self.log_fast, log_number, self._fast_rate)

    @property
    def share(self) -> float:
        """max(0, 1 - fast / slow), in [0, 1]."""
        if self.log_slow == -math.inf:
            return 0.0
        return max(0.0, -math.expm1(min(0.0, self.log_fast - self.log_slow)))


class AugmentedRecovery:
    """Says which share of the particles to draw anew, from the evidence of every measurement.

    Feed :attr:`~filters.belief.Evidence.log_mean` of every accepted measurement; ask for the share when resampling;
    :meth:`restart` after the share was drawn anew, so that the new belief is judged by itself.

    Parameters
    ----------
    slow, fast : float
        Rates of the averages, as in :class:`Averages`.

    Raises
    ------
    ValueError
        Rates out of order or of range.
    """

    def __init__(self, slow: float = 0.002, fast: float = 0.1) -> None:
        Averages(slow, fast)
        self._rates = (slow, fast)
        self._kinds: dict[str, Averages] = {}

    def observe(self, kind: str, log_evidence: float, expected: float = 0.0) -> None:
        """Take the evidence of one accepted measurement.

        Parameters
        ----------
        kind : str
            Of sensor: those of a kind share their averages, in one unit.
        log_evidence : float
            Logarithm of the mean likelihood over the particles with all its constants; minus infinity if none can
            explain the measurement.
        expected : float
            What it would be on average if the belief were right, in the same unit.

        Raises
        ------
        ValueError
            NaN (a measurement that was not accepted has no evidence) or plus infinity.
        """
        relative = log_evidence - expected
        if not relative < math.inf:
            raise ValueError(
                f"recovery: {kind}: log evidence must be finite or -inf, got {log_evidence} (expected {expected})"
            )
        averages = self._kinds.get(kind)
        if averages is None:
            averages = self._kinds[kind] = Averages(*self._rates)
        averages.add(relative)

    @property
    def shares(self) -> dict[str, float]:
        """What each kind of sensor asks for."""
        return {kind: averages.share for kind, averages in self._kinds.items()}

    @property
    def share(self) -> float:
        """Share of the particles to draw anew, in [0, 1]: the mean over the kinds that were heard."""
        shares = self.shares
        return sum(shares.values()) / len(shares) if shares else 0.0

    def forget(self, kind: str) -> None:
        """Leave a kind out until it is heard again: one that has fallen silent has no say."""
        self._kinds.pop(kind, None)

    def restart(self) -> None:
        """Let the fast averages begin again where the slow ones are: what was asked for has been done."""
        for averages in self._kinds.values():
            averages.log_fast = averages.log_slow


def expected_log_evidence(innovation_variances: Iterable[float]) -> float:
    """Return the mean log density of a Gaussian innovation under itself, -1/2 Σ log(2 π e S).

    Parameters
    ----------
    innovation_variances : iterable of float
        S of each dimension measured: the variance of the reading and of what the belief expects of it, together.

    Raises
    ------
    ValueError
        A variance that is not positive and finite.
    """
    total = 0.0
    for variance in innovation_variances:
        if not 0.0 < variance < math.inf:
            raise ValueError(f"expected evidence: variances must be positive and finite, got {variance}")
        total -= 0.5 * math.log(2.0 * math.pi * math.e * variance)
    return total


def _blend(log_old: float, log_new: float, rate: float) -> float:
    """log((1 - rate) old + rate new) without leaving the logarithms."""
    old = log_old + math.log1p(-rate) if rate < 1.0 else -math.inf
    new = log_new + math.log(rate)
    top = max(old, new)
    if top == -math.inf:
        return top
    return top + math.log(math.exp(old - top) + math.exp(new - top))
