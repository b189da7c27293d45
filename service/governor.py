"""The governor: how many particles the next tick can pay for.

Every stage that works on particles has a *shape*, ``overhead + per_particle * count``, measured once on this
machine before the first tick (:mod:`service.rehearsal`). What it costs in operation is told as a multiple of
its shape at the count it worked on; the running high quantile of that multiple is the stage's *scale*. A
machine that slows down, or a vehicle with more readings per tick than the rehearsal had, moves the scale, and
with it the whole line.

So the cost model is affine, ``cost = fixed + per_particle * count``: ``fixed`` sums the quantiles of the
stages that do not depend on particles (ingest, publishing) and the others' scaled overheads, ``per_particle``
sums their scaled slopes, and ``supply = (budget - fixed) / per_particle``. Motion, sensing, resampling *and*
extraction are paid from the budget as if each of them ran in every tick, whether or not the last one needed
it: the tick that does must fit, too. The sum of the stages' quantiles lies above the quantile of their sum
whenever they do not peak together.

The model is exact at the count it was measured at, whatever the shape: scale times shape is the cost. A wrong
shape only makes the way to the right count longer.

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
from service.quantile import RunningQuantile

PROBABILITY = 0.95
WINDOW = 64
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

PER_MEASUREMENT = ("motion", "sensing", "resampling")
"""Stages whose cost grows with the number of measurements, too."""

CLOUD = "cloud"
"""The stage that level 3 leaves out."""

KALMAN = "kalman"
"""The stage of level 4; its shape is over measurements, not particles."""

COLD = 2.0
"""Scale before the first tick: between ticks the caches belong to others, in the rehearsal they did not."""


@dataclass(frozen=True, slots=True)
class Shape:
    """How the cost of a stage depends on the count: seconds per tick, and seconds per particle and tick."""

    overhead: float
    per_particle: float

    def at(self, count: int) -> float:
        """Return the cost at ``count`` particles, seconds."""
        return self.overhead + self.per_particle * count


PROPORTIONAL = Shape(0.0, 1.0)
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
    shapes : Mapping[str, Shape]
        Of the stages that work on particles, as far as they were measured; and of ``kalman`` over measurements, without
        which level 4 is never taken.
    period : float
        Seconds from tick to tick.

    Raises
    ------
    ValueError
        The budget is not positive, or the bounds are not in order.
    """

    def __init__(
        self, budget: float, smallest: int, largest: int, shapes: Mapping[str, Shape], period: float = inf
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
        self._scales = {stage: _expecting(COLD) for stage in self._shapes}
        self._deputy = shapes.get(KALMAN)
        self._deputy_scale = _expecting(COLD)
        self._fixed: dict[str, RunningQuantile] = {}
        self._each = RunningQuantile(WINDOW, PROBABILITY)
        self._waits = RunningQuantile(WINDOW, WAITING)
        self._rung = WHOLE
        self._calm = 0
        self._since_shrinking = SETTLE
        self._limit = self._clamped(self.supply)

    def observe(self, stage: str, seconds: float, count: int) -> None:
        """Learn what a stage cost in a tick that ran it.

        Parameters
        ----------
        stage : str
            Name of the stage.
        seconds : float
            Its cost in this tick.
        count : int
            Particles it worked on; 0 for a stage whose cost does not depend on them.
        """
        if count <= 0:
            if stage not in self._fixed:
                self._fixed[stage] = _expecting(0.0)
            self._fixed[stage].add(seconds)
            return
        if stage not in self._scales:
            self._shapes[stage] = PROPORTIONAL
            self._scales[stage] = RunningQuantile(WINDOW, PROBABILITY)
        self._scales[stage].add(seconds / self._shapes[stage].at(count))

    def observe_measurement(self, seconds: float, count: int) -> None:
        """Learn what one measurement cost in a tick with ``count`` particles, moving and resampling included."""
        shape = self._work_at(count)
        if shape > 0.0:
            self._each.add(seconds / shape)

    def observe_deputy(self, seconds: float, measurements: int) -> None:
        """Learn what a tick of the Kalman filter cost, moving and extraction included."""
        if self._deputy is not None:
            self._deputy_scale.add(seconds / self._deputy.at(measurements))

    def observe_wait(self, seconds: float) -> None:
        """Learn for how long a tick did not have the processor, from its deadline to its end."""
        self._waits.add(max(0.0, seconds))

    @property
    def fixed(self) -> float:
        """Seconds per tick that do not depend on the count."""
        overheads = (self._shapes[stage].overhead * scale.value for stage, scale in self._scales.items())
        return sum(cost.value for cost in self._fixed.values()) + sum(overheads)

    @property
    def per_particle(self) -> float:
        """Seconds per particle and tick."""
        return sum(self._shapes[stage].per_particle * scale.value for stage, scale in self._scales.items())

    @property
    def room(self) -> float:
        """Seconds that a tick may spend: the budget, or what others leave of the period if that is less.

        Others take away no more than :data:`LEAST_SHARE` leaves, and never the least count that the budget has: who
        leaves a tick no time leaves a thinner one none either.
        """
        left = PERIOD_SHARE * self._period - self._waits.value
        least = max(LEAST_SHARE * self._budget, self.fixed + self.per_particle * self._smallest)
        return min(self._budget, max(left, least))

    @property
    def supply(self) -> float:
        """Particles that the budget pays for, before bounds and hysteresis."""
        remaining = max(self.room - self.fixed, 0.0)
        per_particle = self.per_particle
        return remaining / per_particle if per_particle > 0.0 else float(self._largest)

    def reserve(self, count: int) -> float:
        """Seconds to keep for what follows the weighing of ``count`` particles: resampling, extraction, the sending."""
        stages = (self._stage_at(stage, count) for stage in ("resampling", "extraction"))
        if self._rung.level is Level.KALMAN and self._deputy is not None:
            stages = (self._deputy_scale.value * self._deputy.overhead,)
        sending = (self._fixed[stage].value for stage in ("publishing", CLOUD) if stage in self._fixed)
        return sum(stages) + sum(sending)

    def decide(self, demand: int) -> Decision:
        """Decide on the next tick, for a belief that needs ``demand`` particles."""
        supply = self.supply
        self._follow(supply)
        count = min(max(demand, self._smallest), int(self._limit))
        # the product that made the room may round to a hair less than it was made from
        afforded = int(min(self._limit, supply * (1.0 + 1e-9)))
        fits = afforded >= self._smallest
        self._climb(WHOLE if fits else self._fitting())
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
        if len(self._each):
            each = self._each.value * self._work_at(self._smallest)
        else:
            each = sum(self._stage_at(stage, self._smallest) for stage in PER_MEASUREMENT)
        fixed = sum(cost.value for stage, cost in self._fixed.items() if stage != CLOUD)
        left = self.room - fixed - self._stage_at("extraction", self._smallest)
        cloud = self._fixed[CLOUD].value if CLOUD in self._fixed else 0.0
        for level, spare in ((Level.THINNED, left - cloud), (Level.NO_CLOUD, left)):
            if spare >= each:
                return Rung(level, min(CROWD, int(spare / each) if each > 0.0 else CROWD))
        deputised = self._deputised(self.room - fixed)
        return Rung(Level.KALMAN, deputised) if deputised else Rung(Level.PREDICTION_ONLY, 0)

    def _deputised(self, left: float) -> int:
        """Return how many measurements the Kalman filter could take in ``left`` seconds."""
        if self._deputy is None:
            return 0
        scale = self._deputy_scale.value
        spare = left - scale * self._deputy.overhead
        each = scale * self._deputy.per_particle
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
        self._each.scale(FADING)
        resting = ("sensing", "resampling")
        if self._rung.level is Level.KALMAN:
            resting = tuple(self._scales)
        else:
            self._deputy_scale.scale(FADING)
        for stage in resting:
            if stage in self._scales:
                self._scales[stage].scale(FADING)

    def _cause(self, level: Level) -> Cause:
        if level is Level.FULL:
            return Cause.NONE
        return Cause.PROCESSOR if self.room < self._budget else Cause.BUDGET

    def _stage_at(self, stage: str, count: int) -> float:
        return self._scales[stage].value * self._shapes[stage].at(count) if stage in self._scales else 0.0

    def _work_at(self, count: int) -> float:
        return sum(self._shapes[stage].at(count) for stage in PER_MEASUREMENT if stage in self._shapes)

    def _clamped(self, count: float) -> float:
        return min(max(count, float(self._smallest)), float(self._largest))


def _expecting(value: float) -> RunningQuantile:
    """Return a quantile with a past: what is known beforehand, so that one early exception does not rule."""
    quantile = RunningQuantile(WINDOW, PROBABILITY)
    for _ in range(WINDOW):
        quantile.add(value)
    return quantile
