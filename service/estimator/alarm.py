"""When the evidence says that the belief is lost: most of its particles are asked for anew.

The unnormalised evidence is followed (:class:`~filters.recovery.AugmentedRecovery`), each reading's relative to what it
would be on average if the belief were right, and that for each kind of absolute sensor by itself: one kind that
contradicts the belief may be wrong, all of them are not.
"""

from __future__ import annotations

import numpy as np

from drivers.sample import SECOND
from filters.belief import Moments
from filters.linearised.shadow import LINEARISED
from filters.recovery import AugmentedRecovery, expected_log_evidence
from service.estimator.hearing import Heard
from service.estimator.measuring import Measurement

ENOUGH = 0.8
"""Share of the particles to draw anew from which a kind of sensor says that the belief is wrong."""

SILENCE = 5 * SECOND
"""A kind of sensor that has been silent for so long has no say."""

FAST = 0.25
SLOW = 0.002
"""Rates of the averages of the evidence."""


class Alarm:
    """Follows the evidence of a belief since that began.

    Attributes
    ----------
    moments : Moments or None
        What the belief last said of itself; before, nothing is followed.
    """

    def __init__(self) -> None:
        self.moments: Moments | None = None
        self._recovery = AugmentedRecovery(SLOW, FAST)
        self._kinds: dict[str, int] = {}

    def observe(self, one: Heard) -> None:
        """Follow the evidence of one kind of sensor by an absolute measurement."""
        kind = one.measured.name.split("/", 1)[0]
        expected = self._expected(one.measured)
        if expected is None:
            return
        if kind not in self._kinds:
            self._recovery.observe(kind, 0.0)  # a belief is taken to be right until it is heard to be wrong
        self._kinds[kind] = one.time
        self._recovery.observe(kind, one.log_mean, expected)
        for other, last in list(self._kinds.items()):
            if one.time - last > SILENCE:
                del self._kinds[other]
                self._recovery.forget(other)

    @property
    def raised(self) -> bool:
        """Whether every kind of absolute sensor says that most of the belief is wrong."""
        shares = self._recovery.shares
        return bool(shares) and min(shares.values()) >= ENOUGH

    def _expected(self, measured: Measurement) -> float | None:
        """Return the log evidence that the measurement has on average if the belief is right."""
        make, moments = LINEARISED.get(type(measured.model)), self.moments
        if make is None or moments is None:
            return None
        rows = {name: row for row, name in enumerate(moments.names)}
        said = make(measured.model).expect(rows, moments.mean, measured.value)
        covariance = np.diag(moments.variance)
        covariance[:3, :3] = moments.pose_covariance
        variances = np.diagonal(said.jacobian @ covariance @ said.jacobian.T + said.noise)
        return expected_log_evidence(map(float, variances))
