"""Witnesses: for every group of sensors two filters that do not listen to it, and began a while ago.

A witness takes every control and what all other groups measure, so it says where the vehicle is without the group that
is to be judged. It begins as the belief's own Gaussian; what the group told the belief before that is in it, so it is
worth something only from a while back. The two of a group begin in turns, ``SPAN / 2`` apart: one of them always is
between ``SPAN / 2`` and ``SPAN`` old. While the belief is young they begin sooner, each when the other is half as old
as the belief: one that began before gyro and wheels were known soon strays by a metre a second. While anyone is under
suspicion none begins anew: the belief may be wrong already.

A witness is a Kalman filter, linearised about its mean: without wheels and gyro for some seconds its heading is gone,
and what it hears then moves it metres from the truth while it says decimetres. It is dismissed before.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.sample import SECOND
from filters.error_level import ErrorLevel, Opinion
from filters.kalman import Matrix
from filters.kernels.expectations import note
from filters.linearised.bank import BATCHED, Expectations, GaussianBank
from filters.motion.learned import SlowState
from filters.motion.unicycle import Unicycle
from service.estimator.measuring import Measurement

SPAN = 120 * SECOND
"""How old a witness gets. Half of it must be longer than the slowest drag-off takes to be seen: 20 m at 0.5 m/s."""

GATE = 0.9999
"""What a witness is sure to be an outlier it leaves out."""

MOST_NIS = 25.0
"""One measurement contradicts a witness by this much at most."""

WILD, WILD_MEMORY = 13.8, 0.05
"""NIS of a wild reading, and the share of the newest in the running average of how many there are."""

MEMORY = 20.0
"""Seconds over which contradictions are summed up."""

BENT = 0.5
"""Radians: a witness who knows his heading no better is no ellipse, and what he hears since moves him anywhere."""

SLOTS = 2

_HEADING = 2


class Witnesses:
    """The witnesses of up to ``groups`` groups, as one bank: group g has the members 2 g and 2 g + 1.

    Parameters
    ----------
    motion : Unicycle
        How the vehicle moves.
    slow : sequence of RandomWalk or Learned
        Slow states beside it.
    groups : int
        For how many groups there is room.
    """

    def __init__(self, motion: Unicycle, slow: Sequence[SlowState], groups: int) -> None:
        self.bank = GaussianBank(motion, slow, SLOTS * groups)
        self._began = [0] * (SLOTS * groups)
        self._contradiction: Matrix = np.zeros(SLOTS * groups)
        self._wildness: Matrix = np.zeros(SLOTS * groups)
        self._kept: NDArray[np.bool_] = np.zeros(SLOTS * groups, np.bool_)
        self._expected: tuple[Measurement, Expectations] | None = None

    @staticmethod
    def dismiss(live: NDArray[np.bool_], group: int) -> None:
        """Strike a group's witnesses from flags of who is live."""
        live[SLOTS * group : SLOTS * (group + 1)] = False

    def keep(self, group: int, kept: bool) -> None:
        """Keep a group's witnesses whatever they know of their heading: of one that was caught none other may begin."""
        self._kept[SLOTS * group : SLOTS * (group + 1)] = kept

    def clear(self) -> None:
        """Dismiss all of them."""
        self._expected = None
        self.bank.live[:] = False

    def move(self, control: Any, duration: float) -> None:
        """Move them by a control, and dismiss who has lost his heading, but for those that are kept."""
        self._expected = None
        self.bank.predict(control, duration)
        self.bank.live &= (self.bank.covariance[:, _HEADING, _HEADING] <= BENT * BENT) | self._kept
        self._contradiction *= math.exp(-duration / MEMORY)

    def hear(self, group: int, measured: Measurement) -> None:
        """Let all but the group's own take its measurement, and note how it contradicts them."""
        expectations = self._expect(measured)
        if expectations is None:
            return
        chosen = self.bank.live.copy()
        chosen[SLOTS * group : SLOTS * (group + 1)] = False
        if not chosen.any():
            return
        self._expected = None
        nis = self.bank.correct(expectations, chosen, GATE).nis
        components = expectations.residual.shape[1]
        note.direct(
            nis,
            chosen,
            components,
            MOST_NIS,
            WILD,
            measured.repeats,
            WILD_MEMORY,
            self._contradiction,
            self._wildness,
        )

    def _expect(self, measured: Measurement) -> Expectations | None:
        """Return what all expect; a measurement that is judged is heard next, if it is believed."""
        if self._expected is not None and self._expected[0] is measured:
            return self._expected[1]
        if type(measured.model) not in BATCHED:
            return None
        expectations = self.bank.expect(measured.model, measured.value)
        self._expected = measured, expectations
        return expectations

    def judging(self, group: int) -> int | None:
        """Return the member that judges the group: the older one; ``None`` if there is none."""
        return min(self._members(group), key=self._began.__getitem__, default=None)

    def newest(self, group: int) -> int | None:
        """Return when the group's younger witness began, nanoseconds."""
        return max([self._began[member] for member in self._members(group)], default=None)

    def _members(self, group: int) -> list[int]:
        """Return the group's witnesses that are live."""
        live = self.bank.live
        return [member for member in self._slots(group) if live[member]]

    def contradiction(self, group: int) -> float:
        """Return how far the others contradict the group's witness, nats over the last seconds: 0 is normal."""
        member = self.judging(group)
        return math.inf if member is None else 0.5 * float(self._contradiction[member])

    def wildness(self, group: int) -> float:
        """Return which share of what the others measure the group's witness takes for wild, 0 to 1."""
        member = self.judging(group)
        return 0.0 if member is None else float(self._wildness[member])

    def testify(self, group: int, measured: Measurement, level: ErrorLevel) -> dict[int, Opinion]:
        """Say what each of the group's witnesses makes of a measurement of it, by member, the older one first.

        ``level`` is what errors are normal for the sensor.
        """
        members = sorted(self._members(group), key=self._began.__getitem__)
        expectations = self._expect(measured) if members else None
        if expectations is None:
            return {}
        covariance, repeats = self.bank.covariance, measured.repeats
        return {member: level.hear_out(expectations, covariance, member, repeats) for member in members}

    def begin(self, groups: Sequence[int], time: int, mean: Matrix, covariance: Matrix) -> None:
        """Have a witness of each group begin at ``time`` with this Gaussian, in the place of the older one."""
        self._expected = None
        members = [min(self._slots(group), key=self.began) for group in groups]
        self.bank.set_some(members, mean, covariance)
        self._contradiction[members] = self._wildness[members] = 0.0
        for member in members:
            self._began[member] = time

    @staticmethod
    def _slots(group: int) -> range:
        return range(SLOTS * group, SLOTS * (group + 1))

    def began(self, member: int) -> int:
        """Return when a witness began; of a free place, before any."""
        return self._began[member] if self.bank.live[member] else -(2**62)

    def gaussian(self, member: int) -> tuple[Matrix, Matrix]:
        """Return mean and covariance of a witness."""
        return self.bank.mean[member].copy(), self.bank.covariance[member].copy()
