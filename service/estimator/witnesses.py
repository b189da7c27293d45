"""Witnesses: for every group of sensors two filters that do not listen to it, and began a while ago.

A witness takes every control and what all other groups measure, so it says where the vehicle is without the group that
is to be judged. It begins as the belief's own Gaussian; what the group told the belief before that is in it, so it is
worth something only from a while back. The two of a group begin in turns, ``SPAN / 2`` apart: one of them always is
between ``SPAN / 2`` and ``SPAN`` old. While the belief is young they begin sooner, each when the other is half as old
as the belief: one that began before gyro and wheels were known soon strays by a metre a second. While anyone is under
suspicion none begins anew: the belief may be wrong already.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from filters.kalman import Matrix
from filters.kernels.expectations import note
from filters.linearised.bank import BATCHED, GaussianBank
from filters.motion.learned import SlowState
from filters.motion.unicycle import Unicycle
from filters.particle import ParticleFilter
from service.estimator.measuring import Measurement
from service.estimator.start import RECEIVER_BIAS
from service.estimator.track import SECOND

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

SLOTS = 2
SAMPLE = 2048
"""The belief's covariance is taken over about so many particles."""

_HEADING = 2


class Testimony(NamedTuple):
    """What a witness says of a measurement of the group that it does not listen to.

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

    @staticmethod
    def dismiss(live: NDArray[np.bool_], group: int) -> None:
        """Strike a group's witnesses from flags of who is live."""
        live[SLOTS * group : SLOTS * (group + 1)] = False

    def clear(self) -> None:
        """Dismiss all of them."""
        self.bank.live[:] = False

    def move(self, control: Any, duration: float) -> None:
        """Move them by a control."""
        self.bank.predict(control, duration)
        self._contradiction *= math.exp(-duration / MEMORY)

    def hear(self, group: int, measured: Measurement) -> None:
        """Let all but the group's own take its measurement, and note how it contradicts them."""
        if type(measured.model) not in BATCHED:
            return
        chosen = self.bank.live.copy()
        chosen[SLOTS * group : SLOTS * (group + 1)] = False
        if not chosen.any():
            return
        expectations = self.bank.expect(measured.model, measured.value)
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

    def judging(self, group: int) -> int | None:
        """Return the member that judges the group: the older one; ``None`` if there is none."""
        return min(self._members(group), key=self._began.__getitem__, default=None)

    def newest(self, group: int) -> int | None:
        """Return when the group's younger witness began, nanoseconds."""
        return max([self._began[member] for member in self._members(group)], default=None)

    def _members(self, group: int) -> list[int]:
        """Return the group's witnesses that are live."""
        first = SLOTS * group
        live: list[bool] = self.bank.live[first : first + SLOTS].tolist()
        return [first + slot for slot, one in enumerate(live) if one]

    def contradiction(self, group: int) -> float:
        """Return how far the others contradict the group's witness, nats over the last seconds: 0 is normal."""
        member = self.judging(group)
        return math.inf if member is None else 0.5 * float(self._contradiction[member])

    def wildness(self, group: int) -> float:
        """Return which share of what the others measure the group's witness takes for wild, 0 to 1."""
        member = self.judging(group)
        return 0.0 if member is None else float(self._wildness[member])

    def testify(self, group: int, measured: Measurement) -> dict[int, Testimony]:
        """Say what each of the group's witnesses makes of a measurement of it, by member, the older one first."""
        members = sorted(self._members(group), key=self._began.__getitem__)
        if not members or type(measured.model) not in BATCHED:
            return {}
        said = self.bank.expect(measured.model, measured.value)
        testimonies: dict[int, Testimony] = {}
        for member in members:
            testimonies[member] = Testimony(
                said.residual[member], self.bank.spread(said, member), said.noise[member] / measured.repeats
            )
        return testimonies

    def begin(self, group: int, time: int, mean: Matrix, covariance: Matrix) -> None:
        """Have a witness of the group begin at ``time`` with this Gaussian, in the place of the older one."""
        members = range(SLOTS * group, SLOTS * (group + 1))
        member = min(members, key=lambda m: self._began[m] if self.bank.live[m] else -(2**62))
        self.bank.set(member, mean, covariance)
        self._began[member] = time
        self._contradiction[member] = 0.0
        self._wildness[member] = 0.0

    def gaussian(self, member: int) -> tuple[Matrix, Matrix]:
        """Return mean and covariance of a witness."""
        return self.bank.mean[member].copy(), self.bank.covariance[member].copy()


def gaussian_of(belief: ParticleFilter[Any], given_path: dict[str, float]) -> tuple[Matrix, Matrix]:
    """Return mean and covariance of a belief, over an even sample of its particles.

    The errors of receivers, which come last, are left out: witnesses and the like do not have them as states.

    Parameters
    ----------
    given_path : dict[str, float]
        Variances of the marginalised dimensions beside the spread of the particles' own values.
    """
    step = max(1, belief.count // SAMPLE)
    weights = belief.weights[::step].astype(np.float64)
    weights /= weights.sum()
    size = sum(not name.startswith(RECEIVER_BIAS) for name in belief.names)
    columns: NDArray[np.float64] = belief.columns[:size, : belief.count : step].astype(np.float64)
    heading = columns[_HEADING]
    centre = math.atan2(weights @ np.sin(heading), weights @ np.cos(heading))
    columns[_HEADING] = centre + np.remainder(heading - centre + math.pi, 2.0 * math.pi) - math.pi
    mean = columns @ weights
    away = columns - mean[:, None]
    covariance = (away * weights) @ away.T
    for name, variance in given_path.items():
        row = belief.names.index(name)
        covariance[row, row] += variance
    return mean, 0.5 * (covariance + covariance.T)
