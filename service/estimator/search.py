"""Finding the place: at a global start, and when the evidence says that the belief is lost.

A belief that begins *anywhere* in an area is not weighed at first: a few thousand particles over a field would leave
none near the truth. Measurements are gathered instead, and a :class:`~service.estimator.quest.Quest` says where the
vehicle is; the particles are drawn there.

In flight an :class:`~service.estimator.alarm.Alarm` follows the evidence. Where every kind of absolute sensor asks for
most of the particles anew, a quest runs beside the belief, over ticks. What it finds is a
:class:`~service.estimator.rival.Rival`, not yet the belief: first it must predict what comes next, far better than it.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from typing import cast

import numpy as np

from drivers.sample import SECOND
from filters.belief import Evidence, Moments
from filters.kernels.compile import Float32Array
from filters.sensing import (
    Bearing,
    PositionMeasurement,
    RangeBearing,
    RangeBearingMeasurement,
    RangeMeasurement,
)
from filters.sensing.biased_range import BiasedRangeMeasurement
from service.config import Configuration
from service.estimator.alarm import Alarm
from service.estimator.hearing import Heard, Likelihood
from service.estimator.measuring import Measurement
from service.estimator.quest import Box, Quest
from service.estimator.rival import TRIAL, Columns, Rival
from service.estimator.start import MARGINALISED
from service.estimator.vehicle import Vehicle
from service.estimator.way import way_of

MEMORY = 6 * SECOND
"""How long measurements are remembered for a search."""

MOST = 48
"""Measurements that a search looks at, at most; the newest."""

ENOUGH = 12
"""Absolute measurements that a search waits for, at most this long:"""
PATIENCE = 3 * SECOND

LEAST = 4
"""Absolute measurements without which no search is begun."""

PIECES = 50
"""Pieces of work in which a search comes, about; it should be done within a second, if the budget allows."""

SHARE = 0.25
"""Of the budget, that a search may use in a tick,"""
PIECE_MS = 1.0
"""with a piece of so many milliseconds. Where a quarter does not suffice for one, one is done all the same."""


class Search:
    """Listens to all that the belief hears, and looks for the place where there is reason to.

    Parameters
    ----------
    configuration : Configuration
        Where and how the belief starts, and whether recovery is wanted.
    vehicle : Vehicle
        How it moves.
    names : sequence of str
        The belief's dimensions.
    seed : int
        Of the random numbers.
    admitted : callable
        Whether the sensor of that name may be listened to.

    Attributes
    ----------
    blind : bool
        The belief has no place yet: what is measured is gathered here, and does not weigh the particles.
    quests, victories : int
        Searches begun, and rivals that replaced the belief.
    """

    def __init__(
        self,
        configuration: Configuration,
        vehicle: Vehicle,
        names: Sequence[str],
        seed: int,
        admitted: Callable[[str], bool] = lambda name: True,
    ) -> None:
        self.blind = configuration.start.mode == "global"
        self.quests = 0
        self.victories = 0
        self._configuration = configuration
        self._names = tuple(names)
        self._seed = seed
        self._admitted = admitted
        self._watching = configuration.honesty.recovery
        self._way = way_of(vehicle, configuration, (MEMORY + TRIAL) / SECOND)
        self._heard: deque[Heard] = deque(maxlen=MOST)
        most = int(SHARE * configuration.budget.cpu_ms / PIECE_MS)
        self._pieces = max(1, min(math.ceil(PIECES / configuration.loop.rate), most))
        self._quest: Quest | None = None
        self._later: list[Heard] = []
        self._rival: Rival | None = None
        self._alarm = Alarm()

    # --- what the estimator tells -----------------------------------------------------------------------------------

    def started(self, time: int) -> None:
        """Hear that the belief began, or began anew."""
        self._alarm = Alarm()
        self._drop()

    def moved(self, start: int, end: int) -> None:
        """Hear that the belief moved from ``start`` to ``end``."""
        self._way.moved(start, end)

    def published(self, moments: Moments) -> None:
        """Hear what the belief says of itself at the end of a tick."""
        self._alarm.moments = moments

    def weighed(self, time: int, measured: Measurement, evidence: Evidence, outlier: bool) -> None:
        """Hear that the particles were weighed by ``measured``, and what it said of them."""
        if not self._watching or not self._admitted(measured.name):
            return
        one = Heard(time, measured, evidence.log_mean, measured.surprise(evidence.log_mean))
        self._note(one)
        if measured.absolute:
            self._alarm.observe(one)

    def heard(self, time: int, measured: Measurement) -> None:
        """Take a measurement while the belief is blind."""
        self._note(Heard(time, measured, math.nan, 0.0))

    def _note(self, one: Heard) -> None:
        self._heard.append(one)
        while self._heard[0].time < one.time - MEMORY:
            self._heard.popleft()
        if self._rival is not None:
            self._judge(self._rival, one)
        elif self._quest is not None:
            self._later.append(one)

    def placed(self) -> None:
        """Hear that the belief has a place, whatever the configuration says of its start."""
        self.blind = False

    def told(self, configuration: Configuration) -> None:
        """Hear that the belief is to begin anew as ``configuration`` says now; what was heard before is not used."""
        self._configuration = configuration
        self.blind = configuration.start.mode == "global"
        self._heard.clear()
        self._drop()

    @property
    def idle(self) -> bool:
        """Whether there is nothing to search for."""
        searching = self.blind or self._quest is not None or self._rival is not None
        return not searching and not (self._watching and self._alarm.raised)

    # --- one tick ---------------------------------------------------------------------------------------------------

    def work(self, time: int) -> None:
        """Do a tick's share of the work; ``time`` is the belief's."""
        if self._quest is None and self._rival is None:
            self._begin(time)
        elif self._quest is not None and self._rival is None:
            for _ in range(self._pieces):
                if self._quest.advance():
                    self._finish(self._quest)
                    break
        if self._rival is not None and not self.blind and self._rival.hopeless(time):
            self._drop()

    def _begin(self, time: int) -> None:
        if not (self.blind or (self._watching and self._alarm.raised)):
            return
        heard = list(self._heard)
        absolute = [one for one in heard if one.measured.absolute]
        if len(absolute) < LEAST:
            return
        if len(absolute) < ENOUGH and absolute[-1].time - absolute[0].time < PATIENCE:
            return
        box = self._box(absolute)
        if box is None:
            return
        self.quests += 1
        key = (self._seed, self.quests)
        moment = heard[-1].time
        self._quest = Quest(self._configuration, self._names, self._way, heard, moment, box, key)
        self._later = []

    def _box(self, absolute: Sequence[Heard]) -> Box | None:
        area = self._configuration.area
        if self.blind and area is not None:
            return Box(area.north, area.east)
        shape = self._way.shape(absolute[-1].time, [one.time for one in absolute])
        reaches = [
            reach
            for one, far in zip(absolute, shape.reach, strict=True)
            if (reach := _reach(one.measured, float(far)))
        ]
        if not reaches:
            return None if area is None else Box(area.north, area.east)
        north, east, half = np.array(reaches).T
        return Box(
            (float((north - half).min()), float((north + half).max())),
            (float((east - half).min()), float((east + half).max())),
        )

    def _finish(self, quest: Quest) -> None:
        self._quest = None
        self._rival = Rival(quest.columns, quest.moment)
        if not self.blind:
            for one in self._later:
                self._judge(self._rival, one)
        self._later = []

    def _judge(self, rival: Rival, one: Heard) -> None:
        if self.blind:
            return
        shape = self._way.shape(rival.moment, [one.time])
        rival.weigh(Likelihood(self._names, [one], shape).log(rival.columns), one)

    def _apart(self, rival: Rival) -> bool:
        """Say whether more than one thing without a name speaks for a rival."""
        if not rival.unnamed:
            return True
        shape = self._way.shape(rival.moment, [one.time for one, _ in rival.unnamed])
        best = rival.likeliest
        poses = shape.poses({name: column[best : best + 1] for name, column in rival.columns.items()})
        places = zip(*(column[:, 0].tolist() for column in poses), strict=True)
        return rival.apart(
            [
                cast("RangeBearing | Bearing", one.measured.model).place(pose, one.measured.value)
                for (one, _), pose in zip(rival.unnamed, places, strict=True)
            ]
        )

    def _drop(self) -> None:
        self._quest = self._rival = None
        self._later = []

    # --- what was found ---------------------------------------------------------------------------------------------

    def found(self, time: int, count: int) -> Columns | None:
        """Return ``count`` particles at ``time`` (nanoseconds) where the belief is to begin anew, if it is to.

        All columns by name, drawn from what has won, and carried along the way; what the way left open is back where
        it was before anything was measured, because the motion model keeps its own account of it.
        """
        rival = self._rival
        if rival is None or not (self.blind or (rival.wins and self._apart(rival))):
            return None
        generator = np.random.Generator(
            np.random.Philox(key=np.array((self._seed, 2**32 + self.quests), np.uint64))
        )
        columns = rival.draw(self._way.shape(rival.moment, [time]), count, generator)
        for name, (mean, _) in MARGINALISED.items():
            if name in columns:
                columns[name] = np.full(count, mean)
        self.victories += not self.blind
        self.blind = False
        self._drop()
        return {name: columns[name] for name in self._names}

    @property
    def status(self) -> str:
        """What is being done, in the user's words; empty while the belief has a place and there is no doubt of it."""
        if self.blind:
            absolute = sum(one.measured.absolute for one in self._heard)
            return f"searching the area: {absolute} measurements of where the vehicle is so far"
        return ""

    @property
    def elsewhere(self) -> str:
        """That another place explains what is measured, in the user's words; empty while none is known that does."""
        if self.blind or self._rival is None or not (self._rival.leads and self._apart(self._rival)):
            return ""
        return f"another place explains the last {self._rival.heard} better"


def _reach(measured: Measurement, far: float) -> tuple[float, float, float] | None:
    """Return a square (middle north, east, half a side) that the place of a measurement must lie in, or ``None``."""
    value = measured.value
    if isinstance(value, RangeMeasurement | BiasedRangeMeasurement | RangeBearingMeasurement):
        half = 1.2 * value.distance + 5.0 + far
        if value.north is None or value.east is None:
            return _about(cast(RangeBearing, measured.model).landmarks, half)
        return value.north, value.east, half
    if isinstance(value, PositionMeasurement):
        return value.north, value.east, 5.0 * (value.sigma_north or 3.0) + 5.0 + far
    return None


def _about(landmarks: Float32Array, half: float) -> tuple[float, float, float]:
    """Return the square that a place must lie in from which any of the ``landmarks`` was seen ``half`` away."""
    low, high = landmarks.min(axis=0), landmarks.max(axis=0)
    north, east = map(float, 0.5 * (low + high))
    return north, east, half + 0.5 * float((high - low).max())
