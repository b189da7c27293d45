"""The governor: how many particles the next tick can pay for.

Every stage that works on particles has a *shape*, ``constant + slope * count``, measured once on this
machine before the first tick (:mod:`service.rehearsal`): the cost of a tick with one measurement. What it costs in
operation is divided along its shape into a constant and a slope, which is exact at the count that it was measured
at, whatever the shape; a wrong one only makes the way to the right count longer. With the stages that no particle
makes dearer (ingest, witnesses, publishing), a tick is a line over the count, and :class:`service.tick_costs.TickCosts`
keeps those of the last ticks: what nearly every one of them could have had is the supply.

Kept are ticks that weighed something: motion, sensing, resampling *and* extraction are paid from the budget as if
each tick were one of these, for the tick that is must fit, too. A tick without measurements is kept where even that
cost more than there is room for. One that was cut had too many particles: it is kept as if each measurement left out
had cost as much as those that were not. With the fewest particles that would be wrong for ever (the first measurement
carries what all share), so of a tick that left some out there the remembered costs fade, until a whole one is tried.

The count does not hunt: it shrinks at once when the supply falls below it, and grows by at most a tenth per
tick, only while the supply is clearly above it, and never quite up to it.

When not even the least count fits, the work is thinned in the declared order: fewer measurements, as many as the
budget pays for one by one; then no cloud; then a Kalman filter in the particles' place, whose cost is a line over the
measurements; then prediction only, where every measurement is dropped. Down goes at once, up only after :data:`CALM`
ticks that would have had room. What is not done is not measured either: without particles, or with prediction only, the
remembered costs fade until it is tried again.

What a cost is measured in is the caller's choice; the loop uses the processor time of its process, because
the budget is a share of the processor: a tick that was preempted by somebody else has not cost more, and
threads that help have. But a tick whose work does not fit into what others leave of its period makes the next
one late. So the running high quantile of what ticks *waited* (wall time less processor time) is taken off the
period, and where less than the budget remains, that is what is spent. No clock in here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import NamedTuple

from service.estimator.course import CROWD, Cause, Level
from service.estimator.stopwatch import KALMAN, WITNESSES
from service.quantile import RunningQuantile
from service.tick_costs import FREE, PROBABILITY, WINDOW, Line, TickCosts

GROWTH = 1.1
HEADROOM = 0.9
"""Growth stops at this share of the supply; between it and the supply the count stays as it is."""

SETTLE = 32
"""Ticks after a shrinking in which the count does not grow: it turns no more often than that."""

CALM = 64
"""Ticks in a row that must have room for a lower level before it is taken."""

FADING = 0.98
"""What the cost of work that is not done is multiplied with in every tick, until it is tried again."""

PERIOD_SHARE = 0.9
"""Of the period, what ticks may last, waiting included."""

WAITING = 0.9
"""Share of the ticks that waited no longer than is reckoned with: a single stall makes a few late, and is over."""

LEAST_SHARE = 0.25
"""Of the budget, what is spent however long ticks wait: few particles do not make others faster."""

PER_MEASUREMENT = ("motion", "sensing", "resampling", WITNESSES)
"""Stages whose cost grows with the number of measurements, too."""

CLOUD = "cloud"
"""The stage that level 3 leaves out."""

FIXED = ("ingest", "search", "publishing", "other")
"""Stages whose cost grows neither with the count nor with the measurements."""

AFTER = ("resampling", "extraction")
"""Stages that work on the particles after they have been weighed."""

_APART = frozenset((*FIXED, CLOUD, KALMAN))

COLD = 2.0
"""Scale before the first tick: between ticks the caches belong to others, in the rehearsal they did not."""

COLD_MEASUREMENTS = 2
"""Measurements of a tick before the first one."""


PROPORTIONAL = Line(0.0, 1.0)
"""Of a stage that nobody has measured: its whole cost is taken to grow with the count."""


@dataclass(frozen=True, slots=True)
class Decision:
    """What the next tick may do.

    Attributes
    ----------
    count : int
        Particles to use: the smaller of demand and supply, within the configured bounds.
    afforded : int
        Particles that the budget pays for, up to the configured maximum. Under the minimum the vehicle is
        starved: the count stays at the minimum, and every tick costs more than its budget.
    level : Level
        ``FEWER_PARTICLES`` when ``count`` is less than what was demanded; more when not even the least fits.
    cause : Cause
        Whether the budget is what is short, or what others leave of the processor.
    most : int
        How many measurements may be weighed.
    """

    count: int
    afforded: int
    level: Level
    cause: Cause
    most: int


class Rung(NamedTuple):
    """How much of a tick's work is left, beside the particles."""

    level: Level
    most: int


WHOLE = Rung(Level.FULL, CROWD)


class Governor:
    """Sets the particle count from measured cost and the budget.

    Parameters
    ----------
    budget : float
        Seconds per tick, for everything the loop does.
    smallest, largest : int
        Bounds of the count, whatever the budget says.
    shapes : Mapping[str, Line]
        Of the stages that work on particles, in a tick with one measurement, as far as they were measured; and of
        ``kalman`` over measurements, without which level 4 is never taken.
    period : float
        Seconds from tick to tick.

    Raises
    ------
    ValueError
        The budget is not positive, or the bounds are not in order.
    """

    def __init__(
        self, budget: float, smallest: int, largest: int, shapes: Mapping[str, Line], period: float = inf
    ) -> None:
        if budget <= 0.0:
            raise ValueError(f"the budget must be more than 0 seconds per tick, got {budget}")
        if not 1 <= smallest <= largest:
            raise ValueError(f"particles need 1 <= smallest <= largest, got {smallest} and {largest}")
        self._budget = budget
        self._period = period
        self._smallest = smallest
        self._largest = largest
        self._shapes = {stage: shape for stage, shape in shapes.items() if stage != KALMAN}
        self._after = {stage: _expecting(COLD) for stage in AFTER if stage in shapes}
        self._deputy = shapes.get(KALMAN)
        self._deputy_scale = _expecting(COLD)
        self._whole, self._thinned = self._expected(), self._expected()
        self._fixed = _expecting(0.0)
        self._publishing = _expecting(0.0)
        self._cloud = _expecting(0.0)
        self._waits = RunningQuantile(WINDOW, WAITING)
        self._rung = WHOLE
        self._calm = 0
        self._since_shrinking = SETTLE
        self._limit = self._clamped(self.supply)

    def _expected(self) -> TickCosts:
        """Return what ticks are taken to cost before the first one."""
        each, rest = FREE, FREE
        for stage, shape in self._shapes.items():
            if stage in PER_MEASUREMENT:
                each = each.plus(shape.times(COLD))
            else:
                rest = rest.plus(shape.times(COLD))
        return TickCosts(rest, each, COLD_MEASUREMENTS)

    def observe(self, costs: Mapping[str, float], count: int, offered: int, weighed: int) -> None:
        """Learn what a tick cost.

        Parameters
        ----------
        costs : Mapping[str, float]
            Seconds of every stage; 0 for one that did not run.
        count : int
            Particles that it worked on; 0 where it had none, or something else stood in for them.
        offered, weighed : int
            Measurements that were due in the tick, and those of them that were looked at.
        """
        fixed = sum(costs.get(stage, 0.0) for stage in FIXED)
        self._fixed.add(fixed)
        self._publishing.add(costs.get("publishing", 0.0))
        if costs.get(CLOUD, 0.0) > 0.0:
            self._cloud.add(costs[CLOUD])
        if count <= 0:
            return
        work, rest = FREE, Line(fixed, 0.0)
        for stage, seconds in costs.items():
            if seconds <= 0.0 or stage in _APART:
                continue
            line = self._split(stage, seconds, count)
            if stage in PER_MEASUREMENT:
                work = work.plus(line)
            else:
                rest = rest.plus(line)
        all_of_it = rest.plus(work)
        too_dear = all_of_it.at(count) > self.room
        if weighed:
            each = work.times(1.0 / weighed)
            self._thinned.add(rest, each, weighed)
            if weighed == offered or too_dear:
                self._whole.add(rest, each, weighed)
            elif self._rung is WHOLE and count > self._smallest:
                self._whole.add(rest, each, offered)
            else:
                self._whole.fade(FADING)
        elif too_dear and not offered:
            self._whole.add(all_of_it, FREE, 0)
            self._thinned.add(all_of_it, FREE, 0)

    def _split(self, stage: str, seconds: float, count: int) -> Line:
        shape = self._shapes.get(stage, PROPORTIONAL)
        if stage in self._after:
            self._after[stage].add(seconds / shape.at(count))
        return shape.split(seconds, count)

    def observe_deputy(self, seconds: float, measurements: int) -> None:
        """Learn what a tick of the Kalman filter cost, moving and extraction included."""
        if self._deputy is not None:
            self._deputy_scale.add(seconds / self._deputy.at(measurements))

    def observe_wait(self, seconds: float) -> None:
        """Learn for how long a tick did not have the processor, from its deadline to its end."""
        self._waits.add(max(0.0, seconds))

    @property
    def room(self) -> float:
        """Seconds that a tick may spend: the budget, or what others leave of the period if that is less.

        Others take away no more than :data:`LEAST_SHARE` leaves, and never the least count that the budget has: who
        leaves a tick no time leaves a thinner one none either.
        """
        left = PERIOD_SHARE * self._period - self._waits.value
        if left >= self._budget:
            return self._budget
        least = max(LEAST_SHARE * self._budget, self._cloud.value + self._whole.at(self._smallest))
        return min(self._budget, max(left, least))

    @property
    def supply(self) -> float:
        """Particles that the budget pays for, before bounds and hysteresis."""
        return self._whole.particles(self.room - self._cloud.value)

    def reserve(self, count: int) -> float:
        """Seconds to keep for what follows the weighing of ``count`` particles: resampling, extraction, the sending."""
        after = sum(scale.value * self._shapes[stage].at(count) for stage, scale in self._after.items())
        if self._rung.level is Level.KALMAN and self._deputy is not None:
            after = self._deputy_scale.value * self._deputy.constant
        return after + self._publishing.value + self._cloud.value

    def decide(self, demand: int) -> Decision:
        """Decide on the next tick, for a belief that needs ``demand`` particles."""
        # the product that made the room may round to a hair less than it was made from
        supply = self.supply * (1.0 + 1e-9)
        self._climb(WHOLE if supply >= self._smallest else self._fitting())
        self._follow(supply if self._rung is WHOLE else float(self._smallest))
        count = min(max(demand, self._smallest), int(self._limit))
        afforded = int(min(self._limit, supply))
        self._fade()
        level = max(self._rung.level, Level.FEWER_PARTICLES if count < demand else Level.FULL)
        return Decision(count, afforded, level, self._cause(level), self._rung.most)

    def _follow(self, supply: float) -> None:
        """Shrink the limit at once, let it grow slowly."""
        self._since_shrinking += 1
        if supply < self._limit:
            self._limit = self._clamped(supply)
            self._since_shrinking = 0
        elif self._limit < HEADROOM * supply and self._since_shrinking > SETTLE:
            self._limit = self._clamped(min(GROWTH * self._limit, HEADROOM * supply))

    def _fitting(self) -> Rung:
        """Return the first rung on which a tick with the least count fits."""
        for level, spare in ((Level.THINNED, self.room - self._cloud.value), (Level.NO_CLOUD, self.room)):
            most = self._thinned.measurements(spare, self._smallest)
            if most >= 1.0:
                return Rung(level, min(CROWD, int(most)))
        deputised = self._deputised(self.room - self._fixed.value)
        return Rung(Level.KALMAN, deputised) if deputised else Rung(Level.PREDICTION_ONLY, 0)

    def _deputised(self, left: float) -> int:
        """Return how many measurements the Kalman filter could take in ``left`` seconds."""
        if self._deputy is None:
            return 0
        scale = self._deputy_scale.value
        spare = left - scale * self._deputy.constant
        each = scale * self._deputy.slope
        return max(0, min(CROWD, int(spare / each) if each > 0.0 else CROWD))

    def _climb(self, wanted: Rung) -> None:
        """Take a worse rung at once, a better one after it has been wanted for a while."""
        if wanted.level >= self._rung.level:
            self._rung, self._calm = wanted, 0
            return
        self._calm += 1
        if self._calm >= CALM:
            self._rung, self._calm = wanted, 0

    def _fade(self) -> None:
        """Let the cost of what this rung leaves out fade; with the Kalman filter the particles do nothing at all."""
        if self._rung.level < Level.KALMAN or self._calm:
            return  # everything is done, or soon will be
        self._whole.fade(FADING)
        self._thinned.fade(FADING)
        if self._rung.level is not Level.KALMAN:
            self._deputy_scale.scale(FADING)

    def _cause(self, level: Level) -> Cause:
        if level is Level.FULL:
            return Cause.NONE
        return Cause.PROCESSOR if self.room < self._budget else Cause.BUDGET

    def _clamped(self, count: float) -> float:
        return min(max(count, float(self._smallest)), float(self._largest))


def _expecting(value: float) -> RunningQuantile:
    """Return a quantile with a past: what is known beforehand, so that one early exception does not rule."""
    quantile = RunningQuantile(WINDOW, PROBABILITY)
    for _ in range(WINDOW):
        quantile.add(value)
    return quantile
