"""Finding the place: at a global start, and when the evidence says that the belief is lost.

A belief that begins *anywhere* in an area is not weighed at first: a few thousand particles over a field would leave
none near the truth. Measurements are gathered instead, and a :class:`~service.estimator.quest.Quest` says where the
vehicle is; the particles are drawn there.

In flight the unnormalised evidence is followed (:class:`~filters.recovery.AugmentedRecovery`), each reading's relative
to what it would be on average if the belief were right. Where every kind of absolute sensor asks for most of the
particles anew, a quest runs beside the belief, over ticks. What it finds is a rival, not yet the belief: both are asked
to predict the measurements that come next. With L the ratio of the rival's evidence to the belief's over all of these,

    P(L ever exceeds 1 / a) <= a        if the belief is right (Ville's inequality: L is then a martingale of mean 1)

so a rival that must reach 1 / a to win replaces a right belief with a probability of at most a per quest, however long
it is watched. One outlier, or ten from anywhere, do not win: the rival must explain them one after the other.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from drivers.sample import SECOND
from filters.belief import Evidence, Moments
from filters.linearised.shadow import LINEARISED
from filters.recovery import AugmentedRecovery, expected_log_evidence
from filters.resampling import systematic
from filters.sensing import PositionMeasurement, RangeBearingMeasurement, RangeMeasurement
from filters.sensing.biased_range import BiasedRangeMeasurement
from service.config import Configuration
from service.estimator.hearing import Heard, Likelihood
from service.estimator.measuring import Measurement
from service.estimator.quest import POINTS, Box, Quest
from service.estimator.start import MARGINALISED
from service.estimator.vehicle import Vehicle
from service.estimator.way import way_of

Array = NDArray[np.float64]
Columns = dict[str, Array]

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

FALSE_ALARM = 1e-9
"""Probability with which one search replaces a belief that is right."""

ALARM = 0.8
"""Share of the particles to draw anew from which a search is begun."""

LEAST_HEARD = 5
"""Absolute measurements that a rival must have explained before it may win."""

DISBELIEF = 0.5
"""Mean surprise of the belief at these from which it is wrong: a rival that is only a little better must wait."""

HOPELESS = -12.0
"""Logarithm of L below which a rival is given up."""

TRIAL = 10 * SECOND
"""After which it is given up anyhow."""

SILENCE = 5 * SECOND
"""A kind of sensor that has been silent for so long has no say."""

FAST = 0.25
SLOW = 0.002
"""Rates of the averages of the evidence."""


class Rival:
    """What a finished quest found, and how well it predicts since.

    Attributes
    ----------
    log_ratio : float
        Logarithm of L.
    heard : int
        Absolute measurements that both have predicted.
    surprise : float
        The belief's own surprise at these, summed.
    """

    def __init__(self, columns: Columns, moment: int) -> None:
        self.columns = columns
        self.moment = moment
        self.log_ratio = 0.0
        self.heard = 0
        self.surprise = 0.0
        self.log_weights: Array = np.zeros(POINTS)

    def weigh(self, log_likelihood: Array, one: Heard) -> None:
        """Take one more measurement into the comparison."""
        before, after = self.log_weights, self.log_weights + log_likelihood
        self.log_ratio += _log_sum(after) - _log_sum(before) - max(one.log_mean, -1e3)
        self.log_weights = after
        if one.measured.absolute:
            self.heard += 1
            self.surprise += one.surprise

    @property
    def wins(self) -> bool:
        """Whether it has explained enough, and the belief has not."""
        return (
            self.heard >= LEAST_HEARD
            and self.surprise >= DISBELIEF * self.heard
            and self.log_ratio >= -math.log(FALSE_ALARM)
        )


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
        self._recovery = AugmentedRecovery(SLOW, FAST)
        self._kinds: dict[str, int] = {}
        self._moments: Moments | None = None

    # --- what the estimator tells -----------------------------------------------------------------------------------

    def started(self, time: int) -> None:
        """Hear that the belief began, or began anew."""
        self._recovery = AugmentedRecovery(SLOW, FAST)
        self._kinds.clear()
        self._moments = None
        self._drop()

    def moved(self, start: int, end: int) -> None:
        """Hear that the belief moved from ``start`` to ``end``."""
        self._way.moved(start, end)

    def published(self, moments: Moments) -> None:
        """Hear what the belief says of itself at the end of a tick."""
        self._moments = moments

    def weighed(self, time: int, measured: Measurement, evidence: Evidence, outlier: bool) -> None:
        """Hear that the particles were weighed by ``measured``, and what it said of them."""
        if not self._watching or not self._admitted(measured.name):
            return
        one = Heard(time, measured, evidence.log_mean, measured.surprise(evidence.log_mean))
        self._note(one)
        if measured.absolute:
            self._observe(one)

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

    # --- the evidence -----------------------------------------------------------------------------------------------

    def _observe(self, one: Heard) -> None:
        """Follow the evidence of one kind of sensor."""
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

    def _expected(self, measured: Measurement) -> float | None:
        """Return the log evidence that the measurement has on average if the belief is right."""
        make, moments = LINEARISED.get(type(measured.model)), self._moments
        if make is None or moments is None:
            return None
        rows = {name: row for row, name in enumerate(moments.names)}
        said = make(measured.model).expect(rows, moments.mean, measured.value)
        covariance = np.diag(moments.variance)
        covariance[:3, :3] = moments.pose_covariance
        variances = np.diagonal(said.jacobian @ covariance @ said.jacobian.T + said.noise)
        return expected_log_evidence(map(float, variances))

    @property
    def idle(self) -> bool:
        """Whether there is nothing to search for."""
        searching = self.blind or self._quest is not None or self._rival is not None
        return not searching and not (self._watching and self.alarmed)

    @property
    def alarmed(self) -> bool:
        """Whether every kind of absolute sensor says that most of the belief is wrong."""
        shares = self._recovery.shares
        return bool(shares) and min(shares.values()) >= ALARM

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
        if self._rival is not None and self._tired(self._rival, time):
            self._drop()

    def _begin(self, time: int) -> None:
        if not (self.blind or (self._watching and self.alarmed)):
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
        self._rival = Rival(dict(quest.columns), quest.moment)
        if not self.blind:
            for one in self._later:
                self._judge(self._rival, one)
        self._later = []

    def _judge(self, rival: Rival, one: Heard) -> None:
        if self.blind:
            return
        shape = self._way.shape(rival.moment, [one.time])
        rival.weigh(Likelihood(self._names, [one], shape).log(rival.columns), one)

    def _tired(self, rival: Rival, time: int) -> bool:
        return not self.blind and (rival.log_ratio < HOPELESS or time - rival.moment > TRIAL)

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
        if rival is None or not (self.blind or rival.wins):
            return None
        generator = np.random.Generator(
            np.random.Philox(key=np.array((self._seed, 2**32 + self.quests), np.uint64))
        )
        weights = np.exp(rival.log_weights - rival.log_weights.max())
        chosen = systematic(weights, count, 1.0 - generator.random())
        generator.shuffle(chosen)
        columns = {name: column[chosen] for name, column in rival.columns.items()}
        shape = self._way.shape(rival.moment, [time])
        poses = shape.poses(columns)
        blur, swing = math.sqrt(float(shape.variance[0])), math.sqrt(float(shape.turn_variance[0]))
        columns["north"] = poses.north[0] + blur * generator.standard_normal(count)
        columns["east"] = poses.east[0] + blur * generator.standard_normal(count)
        columns["heading"] = poses.heading[0] + swing * generator.standard_normal(count)
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


def _reach(measured: Measurement, far: float) -> tuple[float, float, float] | None:
    """Return a square (middle north, east, half a side) that the place of a measurement must lie in, or ``None``."""
    value = measured.value
    if isinstance(value, RangeMeasurement | BiasedRangeMeasurement | RangeBearingMeasurement):
        if value.north is None or value.east is None:
            return None
        return value.north, value.east, 1.2 * value.distance + 5.0 + far
    if isinstance(value, PositionMeasurement):
        return value.north, value.east, 5.0 * (value.sigma_north or 3.0) + 5.0 + far
    return None


def _log_sum(logs: Array) -> float:
    top = float(logs.max())
    return top + math.log(float(np.exp(logs - top).sum()))
