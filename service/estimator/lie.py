"""Whether a receiver's velocity is part of the lie that its position tells.

A spoofer who leads a receiver away leads both away: the position's error grows by just the velocity's error. Jamming
and reflections strike the position alone: it jumps by hundreds of metres while the velocity stays what the wheels
say. So a binary Bayes filter in log odds (Table 4.2) weighs two stories of the velocity's innovation v while the
position is distrusted: it is nought, or it is the rate rho at which the position's innovation changes. With S the
variance of v, and R that of rho::

    evidence = (|v - rho|² - n R - |v|²) / (2 (S + R))

whose mean is zero where the two cannot be told apart. Until the first story has won, the velocity is distrusted, too.
"""

from __future__ import annotations

from collections import deque

from drivers.sample import SECOND
from filters.binary import BinaryBayesFilter
from filters.error_level import Testimony

BASE = 2 * SECOND
"""Over which the rate of the position's innovation is taken, nanoseconds."""

MOST = 3.0
"""Log odds that a second adds at most."""

LIMIT, CONVINCED = 6.0, 4.0
"""Log odds: the bound, and from where on the velocity is left out of the accusation."""


class Lie:
    """What is known of a group's lie."""

    def __init__(self) -> None:
        self._odds = BinaryBayesFilter(0.5, (), LIMIT)
        self._trail: deque[tuple[int, tuple[float, float], float]] = deque(maxlen=64)

    @property
    def leaves_alone(self) -> bool:
        """Whether the velocity goes its own way, and may be believed though the position lies."""
        return float(self._odds.log_odds) >= CONVINCED

    def begin(self) -> None:
        """Begin to wonder: a sensor of the group has just been caught."""
        self._odds.log_odds[...] = 0.0

    def hear(self, time: int, testimony: Testimony, weight: float, absolute: bool) -> None:
        """Hear what a witness said of a position (``absolute``) or of a velocity, both in two dimensions."""
        residual = testimony.residual
        if residual.size != 2:
            return
        if not absolute:
            self._compare(testimony, weight)
            return
        north, east = residual.tolist()
        self._trail.append((time, (north, east), sum(testimony.noise.tolist()) / 2.0))
        while time - self._trail[0][0] > BASE and len(self._trail) > 2:
            self._trail.popleft()

    def _compare(self, testimony: Testimony, weight: float) -> None:
        if len(self._trail) < 2:
            return
        (start, first, noise), (end, last, later_noise) = self._trail[0], self._trail[-1]
        elapsed = (end - start) / SECOND
        if elapsed < 0.5:
            return
        rate_variance = (noise + later_noise) / elapsed**2
        north, east = testimony.residual.tolist()
        (nn, _), (_, ee) = testimony.spread.tolist()
        variance = 0.5 * (nn + ee) + sum(testimony.noise.tolist()) / 2.0
        apart_north = north - (last[0] - first[0]) / elapsed
        apart_east = east - (last[1] - first[1]) / elapsed
        apart = apart_north * apart_north + apart_east * apart_east
        gain = apart - 2.0 * rate_variance - (north * north + east * east)
        evidence = gain / (2.0 * (variance + rate_variance))
        self._odds.add(weight * min(MOST, max(-MOST, evidence)))
