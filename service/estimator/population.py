"""How many particles there are: what the belief demands, what the tick affords, and when they are drawn anew."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from typing import Any

from drivers.sample import SECOND
from filters.kld import Demand
from filters.particle import ParticleFilter
from filters.policy import EffectiveShare, Policy, Wear, WhenStill
from service.config import Configuration
from service.estimator.hypotheses import Tracker
from service.estimator.receivers import Receivers
from service.estimator.stopwatch import Stopwatch

RESAMPLING: Policy = WhenStill(still=EffectiveShare(0.05), moving=EffectiveShare(0.5))
"""When to resample: equation 4.36's effective sample size below half of the particles there are. What is forgotten
while nothing moves is never brought back, so then the weights multiply up until hardly any particle is left."""

POSITION_BIN = 0.25
HEADING_BIN = 0.1
"""Sides of the bins that the KLD bound counts: metres and radians."""

KLD_ERROR = 0.01
"""Nats. The bins count the pose only; the slow states beside it want several particles in each of its bins."""

COLLAPSED = EffectiveShare(0.1)
"""What tracking hardly ever comes to: what was measured is far sharper than the belief, as after a wide start. Few
particles would be left, and of two places one by chance."""

OUTLIVES = 0.25
"""Share of the particles that is effective when the weights have been tempered for that."""

DEMAND_INTERVAL = SECOND // 5
GROWTH = 1.25
"""The set grows between resamplings only if the demand is this much larger than the count."""


class Population:
    """The number of particles of a belief.

    Parameters
    ----------
    configuration : Configuration
        Its ``[budget]``.
    belief : ParticleFilter
        Whose particles they are.
    stopwatch : Stopwatch
        Charged with the resampling.

    Attributes
    ----------
    demand_of : Callable[[ParticleFilter], int]
        How many particles a belief needs, by the KLD bound.
    demand : int
        How many the belief needs (KLD bound, and enough for each hypothesis), as reckoned last.
    tracker : Tracker or None
        Draws by hypothesis while there are several.
    receivers : Receivers or None
        Whose errors go with a place that is drawn anew.
    """

    def __init__(
        self, configuration: Configuration, belief: ParticleFilter[Any], stopwatch: Stopwatch
    ) -> None:
        self._budget = configuration.budget
        self._belief = belief
        self._stopwatch = stopwatch
        self.demand_of: Callable[[ParticleFilter[Any]], int] = Demand(
            POSITION_BIN,
            HEADING_BIN,
            error=KLD_ERROR,
            minimum=self._budget.particles_min,
            maximum=self._budget.particles_max,
        ).particles
        self.demand = self._budget.particles_min
        self.tracker: Tracker | None = None
        self.receivers: Receivers | None = None
        self.still: Callable[[], float] = lambda: 0.0
        self._reckoned = -(2**62)

    def clamp(self, wanted: int, afforded: int) -> int:
        """Return the smaller of the two, within the configured bounds."""
        return max(self._budget.particles_min, min(wanted, afforded, self._budget.particles_max))

    def resample_if_worn(self, afforded: int) -> None:
        """Normalise the weights, and draw anew where they differ too much (lines 8 to 11 of Table 4.3).

        Where next to nothing is left the weights are tempered before, and the copies drawn apart after it
        (:mod:`filters.rejuvenation`).
        """
        belief = self._belief
        belief.normalize()
        wear = Wear(belief.count, belief.effective_sample_size, self.still())
        if RESAMPLING.due(wear):
            collapsed = COLLAPSED.due(wear)
            if collapsed:
                belief.temper(OUTLIVES)
            self.resample(afforded)
            if collapsed:
                with nullcontext() if self.receivers is None else self.receivers.kept():
                    belief.rejuvenate(HEADING_BIN / POSITION_BIN)
        self._stopwatch.lap("resampling")

    def resample(self, afforded: int) -> None:
        """Draw as many particles as are demanded and afforded.

        Where there is one place only, what is marginalised is opened again (:mod:`filters.reopening`).
        """
        count = self.clamp(self.demand, afforded)
        if self.tracker is not None and self.tracker.divided:
            self.tracker.draw(count)
        else:
            worth = self._belief.effective_sample_size
            self._belief.resample(count)
            self._belief.reopen(worth)

    def fit(self, afforded: int) -> None:
        """Shrink at once when the budget shrank; grow between resamplings only when the demand grew clearly."""
        count, target = self._belief.count, self.clamp(self.demand, afforded)
        if count > max(afforded, self._budget.particles_min) or target > GROWTH * count:
            self._belief.normalize()
            self.resample(afforded)
            self._stopwatch.lap("resampling")

    def begun(self, now: int) -> None:
        """Reckon the demand of particles that were just drawn: the first measurement may wear them at once."""
        self._reckoned = -(2**62)
        self.reckon(now)

    def reckon(self, now: int) -> None:
        """Reckon the demand, if the last time is long enough ago."""
        if now - self._reckoned >= DEMAND_INTERVAL:
            demand = self.demand_of(self._belief)
            if self.tracker is not None:
                demand = min(max(demand, self.tracker.demand), self._budget.particles_max)
            self.demand = demand
            self._reckoned = now
            self._stopwatch.lap("resampling")
