"""The hypotheses of the estimator's belief: looked for ten times a second, kept alive, and spoken for.

What they are and how they are followed is said in :mod:`filters.hypotheses`; here it is decided when to look, how many
particles they need, what counts as a jump of the position, and in which words ambiguity is told. While all particles
are of one hypothesis the belief is resampled and published as if nobody looked.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.sample import SECOND
from filters.belief import Displacement, Evidence
from filters.hypotheses import Hypotheses
from filters.labelled_moments import Hypothesis
from filters.particle import ParticleFilter
from service.estimator.measuring import Measurement

Array = NDArray[np.float64]

INTERVAL = SECOND // 10
"""Between two looks."""

RESOLUTION = 1.0
"""Metres; places nearer to each other than about twice this are one."""

EACH = 2500
"""Particles that each hypothesis demands: by fewer its evidence is known too badly to weigh it against another's."""

AMBIGUOUS = 0.05
"""Share that must lie elsewhere than with the leader for the belief to be ambiguous: less is inside its 95 %."""

CLEAR = 0.02
"""Share below which it is ambiguous no more."""

JUMP = 3.0
"""Standard deviations of a hypothesis by which the position must move for it to be a jump, when the belief divides."""


class Tracker:
    """Follows the hypotheses of a particle filter; a :class:`~service.estimator.companion.Companion`.

    Parameters
    ----------
    belief : ParticleFilter

    Attributes
    ----------
    jumps : int
        How often the position of the leader was suddenly elsewhere: another leads, or the leader was divided.
    """

    def __init__(self, belief: ParticleFilter[Any]) -> None:
        self.jumps = 0
        self._belief = belief
        self._hypotheses = Hypotheses(belief.capacity, len(belief.names), resolution=RESOLUTION)
        self._looked = -(2**62)
        self._ambiguous = False
        self._newest: list[Hypothesis] = []
        self._parted = False
        self._position = np.zeros(2)

    # --- as a companion -------------------------------------------------------------------------------------------

    def started(self, time: int) -> None:
        """Forget all: the particles were drawn anew."""
        self._hypotheses.restart()
        self._looked = -(2**62)
        self._ambiguous = False
        self._newest = []
        self._parted = False

    def moved(self, start: int, end: int) -> None:
        """Do nothing: the labels move with the particles."""

    def weighed(self, time: int, measured: Measurement, evidence: Evidence, outlier: bool) -> None:
        """Do nothing: the weights say it."""

    # --- looking, and drawing -------------------------------------------------------------------------------------

    @property
    def divided(self) -> bool:
        """Whether there are several hypotheses, or strays beside the one."""
        return self._hypotheses.divided

    @property
    def count(self) -> int:
        """How many hypotheses there are."""
        return self._hypotheses.count

    @property
    def leader(self) -> int:
        """The name of the leading one."""
        return self._hypotheses.leader

    @property
    def demand(self) -> int:
        """How many particles they need; none beyond the belief's own if there is one."""
        return EACH * self.count if self.count > 1 else 0

    def look(self, now: int) -> None:
        """Look, if the last time is long enough ago, for what has become of the hypotheses."""
        if now - self._looked < INTERVAL:
            return
        self._looked = now
        belief, hypotheses = self._belief, self._hypotheses
        leader, count = hypotheses.leader, hypotheses.count
        hypotheses.look(belief.columns, belief.weights, belief.count)
        if hypotheses.leader != leader:
            self.jumps += 1
        else:
            self._parted |= hypotheses.count > count

    def draw(self, count: int) -> None:
        """Resample by hypothesis, ``count`` particles in all, and draw the copies of each apart."""
        belief, hypotheses = self._belief, self._hypotheses
        quotas = hypotheses.quotas(belief.weights, belief.count, count)
        worths = hypotheses.worths(belief.weights, belief.count)
        belief.resample_by_label(hypotheses.labels, quotas)
        belief.draw_apart(hypotheses.labels, worths, RESOLUTION)

    # --- what is published ----------------------------------------------------------------------------------------

    def extract(self, displacement: Displacement) -> list[Hypothesis]:
        """Return the hypotheses, the leader first, of the particles displaced; none while all are of one.

        They are remembered for :meth:`ambiguity`.
        """
        belief = self._belief
        self._newest = []
        if self.divided:
            self._newest = self._hypotheses.moments(
                belief.columns, belief.weights, belief.count, displacement
            )
        return self._newest

    def spoken(self, mean: Array, deviation: float) -> None:
        """Hear which mean is published, and the leader's own deviation (m); after a division it may be a jump."""
        if self._parted:
            away = float(np.hypot(*(mean[:2] - self._position)))
            self.jumps += away > max(RESOLUTION, JUMP * deviation)
            self._parted = False
        self._position = mean[:2]

    def ambiguity(self) -> str:
        """Say which places the belief holds, in the user's words, if it is ambiguous; empty if not."""
        if self.count < 2 or len(self._newest) < 2:
            self._ambiguous = False
            return ""
        elsewhere = 1.0 - self._newest[0].weight
        self._ambiguous = elsewhere >= (CLEAR if self._ambiguous else AMBIGUOUS)
        return _told(self._newest) if self._ambiguous else ""


def _told(hypotheses: list[Hypothesis]) -> str:
    shares = [f"{hypothesis.weight:.0%}".replace("%", " %") for hypothesis in hypotheses]
    leader = hypotheses[0].mean
    apart = [float(np.hypot(*(other.mean[:2] - leader[:2]))) for other in hypotheses[1:]]
    told = f"{len(hypotheses)} hypotheses, {', '.join(shares[:-1])} and {shares[-1]}"
    if max(apart) >= RESOLUTION:
        return f"{told}, {'up to ' if len(apart) > 1 else ''}{max(apart):.0f} m apart"
    turned = [abs(math.remainder(float(other.mean[2] - leader[2]), math.tau)) for other in hypotheses[1:]]
    return f"{told}, headings {math.degrees(max(turned)):.0f}° apart"
