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

What a cost is measured in is the caller's choice; the loop uses the processor time of its process, because
the budget is a share of the processor: a tick that was preempted by somebody else has not cost more, and
threads that help have. Being preempted shows in the lateness, which is wall time. No clock in here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum

from service.quantile import RunningQuantile

PROBABILITY = 0.95
WINDOW = 64
GROWTH = 1.1
HEADROOM = 0.9
"""Growth stops at this share of the supply; between it and the supply the count stays as it is."""


COLD = 2.0
"""Scale before the first tick: between ticks the caches belong to others, in the rehearsal they did not."""


class Level(IntEnum):
    """How far a tick was degraded, in the declared order; the loop's governor decides the first two."""

    FULL = 0
    FEWER_PARTICLES = 1


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
        ``FEWER_PARTICLES`` when ``count`` is less than what was demanded.
    """

    count: int
    afforded: int
    level: Level


class Governor:
    """Sets the particle count from measured cost and the budget.

    Parameters
    ----------
    budget : float
        Seconds per tick, for everything the loop does.
    smallest, largest : int
        Bounds of the count, whatever the budget says.
    shapes : Mapping[str, Shape]
        Of the stages that work on particles, as far as they were measured.

    Raises
    ------
    ValueError
        The budget is not positive, or the bounds are not in order.
    """

    def __init__(self, budget: float, smallest: int, largest: int, shapes: Mapping[str, Shape]) -> None:
        if budget <= 0.0:
            raise ValueError(f"the budget must be more than 0 seconds per tick, got {budget}")
        if not 1 <= smallest <= largest:
            raise ValueError(f"particles need 1 <= smallest <= largest, got {smallest} and {largest}")
        self._budget = budget
        self._smallest = smallest
        self._largest = largest
        self._shapes = dict(shapes)
        self._scales = {stage: _expecting(COLD) for stage in shapes}
        self._fixed: dict[str, RunningQuantile] = {}
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
    def supply(self) -> float:
        """Particles that the budget pays for, before bounds and hysteresis."""
        remaining = max(self._budget - self.fixed, 0.0)
        per_particle = self.per_particle
        return remaining / per_particle if per_particle > 0.0 else float(self._largest)

    def decide(self, demand: int) -> Decision:
        """Decide on the next tick, for a belief that needs ``demand`` particles."""
        supply = self.supply
        if supply < self._limit:
            self._limit = self._clamped(supply)
        elif self._limit < HEADROOM * supply:
            self._limit = self._clamped(min(GROWTH * self._limit, HEADROOM * supply))
        count = min(max(demand, self._smallest), int(self._limit))
        afforded = int(min(self._limit, supply))
        return Decision(count, afforded, Level.FEWER_PARTICLES if count < demand else Level.FULL)

    def _clamped(self, count: float) -> float:
        return min(max(count, float(self._smallest)), float(self._largest))


def _expecting(value: float) -> RunningQuantile:
    """Return a quantile with a past: what is known beforehand, so that one early exception does not rule."""
    quantile = RunningQuantile(WINDOW, PROBABILITY)
    for _ in range(WINDOW):
        quantile.add(value)
    return quantile
