"""The binary Bayes filter in log odds: something that is either so or not so, and does not change.

Table 4.2, binary_Bayes_filter, section 4.2 of *Probabilistic Robotics*. The odds of a state are p / (1 - p)
(eq. 4.12), their logarithm l runs from minus to plus infinity (4.13), and the belief comes back as
1 - 1 / (1 + exp l) (4.14). The state being static, the belief depends on the measurements alone (4.11);
Bayes' rule (4.15), turned round with the inverse model (4.16) for the state (4.17) and for its opposite (4.18),
divided by each other (4.19), leaves a sum:

    l_t = l_{t-1} + log p(x | z_t) / (1 - p(x | z_t)) - log p(x) / (1 - p(x))          (4.20)
    l_0 = log p(x) / (1 - p(x))                                                        (4.21)

p(x | z) is an *inverse* measurement model: of a picture it is easier to say whether it shows a closed door
than how likely it is among the pictures of closed doors. Where the forward model p(z | x) is known, the log
likelihood ratio log p(z | x) - log p(z | not x) is added instead. One filter holds any number of such states,
each for itself: sensors, doors, the cells of a map.

Certainty. A measurement that claims p(x | z) = 0 or 1 counts as ``CERTAINTY``, so infinities never enter and
no measurement is final: from a prior of one half, an equal claim to the contrary takes it back exactly.
``limit`` bounds the belief itself, so that a state that did change after all is noticed after a bounded number
of measurements, at the price that what was clipped is forgotten (Hornung et al., "OctoMap", Autonomous Robots
34, 2013, eq. 4).
"""

from __future__ import annotations

import math
import sys
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

CERTAINTY = 36.0
"""Log odds that a measurement claims at most: one minus the probability is 2e-16, the last bit of one."""


def log_odds(probability: ArrayLike) -> Array:
    """Equation 4.13: l = log p / (1 - p), of any shape; minus or plus infinity at 0 and 1."""
    p = np.asarray(probability, np.float64)
    with np.errstate(divide="ignore"):
        return np.log(p) - np.log1p(-p)


def probability(log_odds: ArrayLike) -> Array:
    """Equation 4.14: p = 1 - 1 / (1 + exp l), of any shape; small probabilities keep all their digits."""
    odds = np.asarray(log_odds, np.float64)
    small = np.exp(-np.abs(odds))
    return np.asarray(np.where(odds < 0.0, small, 1.0) / (1.0 + small), np.float64)


class BinaryBayesFilter:
    """Beliefs about binary states, as log odds: Table 4.2.

    Parameters
    ----------
    prior : array
        p(x) of each state, strictly between 0 and 1; a number with ``shape``, or an array of that shape.
    shape : tuple of int
        Of the states; () for one alone.
    limit : float
        Largest magnitude of the belief's log odds; infinity for none.

    Raises
    ------
    ValueError
        A prior not inside (0, 1), or outside the limit; a limit not positive; shapes that do not fit.
    """

    def __init__(self, prior: ArrayLike = 0.5, shape: tuple[int, ...] = (), limit: float = math.inf) -> None:
        given = np.asarray(prior, np.float64)
        if not ((given > 0.0) & (given < 1.0)).all():
            raise ValueError(f"binary filter: the prior must lie inside (0, 1), got {given.tolist()}")
        if not limit > 0.0:
            raise ValueError(f"binary filter: limit must be positive, got {limit}")
        start = log_odds(given)
        if (np.abs(start) > limit).any():
            raise ValueError(f"binary filter: the prior's log odds must lie within the limit {limit}")
        try:
            start = np.array(np.broadcast_to(start, shape if shape else start.shape))
        except ValueError:
            raise ValueError(
                f"binary filter: the prior's shape {given.shape} does not fit the shape {shape}"
            ) from None
        self.limit = limit
        self.prior: Array = start
        """l_0 of each state, equation 4.21."""
        self.log_odds: Array = self.prior.copy()
        """l_t of each state."""

    @property
    def belief(self) -> Array:
        """Probability of each state, equation 4.14."""
        return probability(self.log_odds)

    def update(self, posterior: ArrayLike, cells: object = ...) -> None:
        """Line 2 of Table 4.2, with what the inverse model says: p(x | z).

        Parameters
        ----------
        posterior : array
            p(x | z) in [0, 1] for each of ``cells``; what equals the prior changes nothing.
        cells : index
            Which states, as numpy indexes; all by default. A state named twice is measured twice.

        Raises
        ------
        ValueError
            A probability outside [0, 1] or NaN; nothing has changed then.
        """
        claimed = np.asarray(posterior, np.float64)
        if not ((claimed >= 0.0) & (claimed <= 1.0)).all():
            raise ValueError(f"binary filter: p(x | z) must lie in [0, 1], got {_wrong(claimed, 0.0, 1.0)}")
        prior: Array = self.prior[cast(Any, cells)]
        self.add(np.clip(log_odds(claimed), -CERTAINTY, CERTAINTY) - prior, cells)

    def update_forward(self, given_true: ArrayLike, given_false: ArrayLike, cells: object = ...) -> None:
        """Bayes' rule with the forward model (4.15), divided as in 4.19: adds log p(z | x) / p(z | not x).

        Parameters
        ----------
        given_true, given_false : array
            p(z | x) and p(z | not x), not negative and finite, for each of ``cells``. A zero counts as the
            other times exp(-``CERTAINTY``) at least.
        cells : index
            Which states; all by default.

        Raises
        ------
        ValueError
            A likelihood negative or not finite, or both zero; nothing has changed then.
        """
        true, false = np.asarray(given_true, np.float64), np.asarray(given_false, np.float64)
        for likelihood in (true, false):
            if not ((likelihood >= 0.0) & np.isfinite(likelihood)).all():
                raise ValueError(
                    f"binary filter: likelihoods must be finite and not negative, got "
                    f"{_wrong(likelihood, 0.0, sys.float_info.max)}"
                )
        if ((true == 0.0) & (false == 0.0)).any():
            raise ValueError("binary filter: p(z | x) and p(z | not x) are both zero: z cannot have happened")
        with np.errstate(divide="ignore"):
            ratio = np.log(true) - np.log(false)
        self.add(np.clip(ratio, -CERTAINTY, CERTAINTY), cells)

    def add(self, evidence: ArrayLike, cells: object = ...) -> None:
        """Add log odds as they are, within the limit: what both updates come to.

        Raises
        ------
        ValueError
            Evidence that is not finite; nothing has changed then.
        """
        if isinstance(evidence, float) and isinstance(cells, int) and math.isfinite(evidence):
            # one number for one state: what follows, in a tenth of the time
            moved = float(self.log_odds[cells]) + evidence
            self.log_odds[cells] = min(max(moved, -self.limit), self.limit)
            return
        amount = np.asarray(evidence, np.float64)
        if not np.isfinite(amount).all():
            wrong = _wrong(amount, -sys.float_info.max, sys.float_info.max)
            raise ValueError(f"binary filter: log odds to add must be finite, got {wrong}")
        np.add.at(self.log_odds, cast(Any, cells), amount)
        np.clip(self.log_odds, -self.limit, self.limit, out=self.log_odds)

    def predict(self, failing: ArrayLike, mending: ArrayLike) -> None:
        """Let the states change after all: line 3 of Table 4.1 for two states, in log odds.

        The book's binary state is static. A sensor's health is not: it may fail, and be mended.

        Parameters
        ----------
        failing, mending : array
            p(not x | x) and p(x | not x) since the last call, in [0, 1]; broadcast to the states.

        Raises
        ------
        ValueError
            A probability outside [0, 1]; nothing has changed then.
        """
        a, b = np.asarray(failing, np.float64), np.asarray(mending, np.float64)
        for chance in (a, b):
            if not ((chance >= 0.0) & (chance <= 1.0)).all():
                raise ValueError(
                    f"binary filter: chances of change lie in [0, 1], got {_wrong(chance, 0.0, 1.0)}"
                )
        true, false = self.belief, probability(-self.log_odds)
        with np.errstate(divide="ignore"):
            moved = np.log((1.0 - a) * true + b * false) - np.log(a * true + (1.0 - b) * false)
        self.log_odds[...] = np.clip(moved, -self.limit, self.limit)


def _wrong(values: Array, least: float, most: float) -> float:
    return float(values[~((values >= least) & (values <= most))].flat[0])
