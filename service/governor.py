"""The governor: how many particles the next tick can pay for.

Cost model, affine in the count: ``cost = fixed + per_particle * count``. ``fixed`` sums the running high
quantiles of the stages that do not depend on the particles (ingest, publishing); ``per_particle`` sums those
of the other stages' cost divided by their count. Motion, sensing, resampling *and* extraction are paid from
the budget as if each of them ran in every tick, whether or not the last one needed it: the tick that does
need all of them must fit too. The sum of the stages' quantiles lies above the quantile of their sum whenever
they do not peak together.

``supply = (budget - fixed) / per_particle``. The overhead of a call hides in ``per_particle`` when the count
is small, so a first answer from a small count is too low; but each answer is exact at the count it was
measured at, so the iteration climbs to the one count whose true cost is the budget, from either side, and
stays there.

The count does not hunt: it shrinks at once when the supply falls below it, and grows by at most a tenth per
tick, only while the supply is clearly above it, and never quite up to it.

What a cost is measured in is the caller's choice; the loop uses the processor time of its process, because
the budget is a share of the processor: a tick that was preempted by somebody else has not cost more, and
threads that help have. Being preempted shows in the lateness, which is wall time. No clock in here.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from service.quantile import RunningQuantile

PROBABILITY = 0.95
WINDOW = 64
GROWTH = 1.1
HEADROOM = 0.9
"""Growth stops at this share of the supply; between it and the supply the count stays as it is."""

FIRST_GUESS = 50e-9
"""Seconds per particle and tick until measured: eight times the figure of a desktop processor."""


class Level(IntEnum):
    """How far a tick was degraded, in the declared order; the loop's governor decides the first two."""

    FULL = 0
    FEWER_PARTICLES = 1


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

    Raises
    ------
    ValueError
        The budget is not positive, or the bounds are not in order.
    """

    def __init__(self, budget: float, smallest: int, largest: int) -> None:
        if budget <= 0.0:
            raise ValueError(f"the budget must be more than 0 seconds per tick, got {budget}")
        if not 1 <= smallest <= largest:
            raise ValueError(f"particles need 1 <= smallest <= largest, got {smallest} and {largest}")
        self._budget = budget
        self._smallest = smallest
        self._largest = largest
        self._fixed: dict[str, RunningQuantile] = {}
        self._per_particle: dict[str, RunningQuantile] = {}
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
        table, cost = (self._per_particle, seconds / count) if count > 0 else (self._fixed, seconds)
        if stage not in table:
            table[stage] = RunningQuantile(WINDOW, PROBABILITY)
        table[stage].add(cost)

    @property
    def fixed(self) -> float:
        """Seconds per tick that do not depend on the count."""
        return sum(cost.value for cost in self._fixed.values())

    @property
    def per_particle(self) -> float:
        """Seconds per particle and tick; at least :data:`FIRST_GUESS` until a window was measured."""
        measured = sum(cost.value for cost in self._per_particle.values())
        seen = max((len(cost) for cost in self._per_particle.values()), default=0)
        return measured if seen >= WINDOW else max(measured, FIRST_GUESS)

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
