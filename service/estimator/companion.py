"""Who goes along with an estimator: is told of its every call on the belief, and changes nothing.

The estimator decides when the belief starts, over which stretches it moves, and which measurements are weighed in
which order. A companion sees exactly these decisions, so whatever it computes is of the same samples: another filter to
compare with (:class:`~service.estimator.shadow.Shadow`), or a record of the innovations. The daemon's loop has none,
and pays an empty loop for them.
"""

from __future__ import annotations

from typing import Protocol

from filters.belief import Belief, Evidence, Moments
from service.estimator.binding import Measurement


class Watched(Belief, Protocol):
    """A belief that can be looked on without being moved."""

    def glance(self) -> Moments:
        """Say its moments, and go on as if nobody had asked."""
        ...


class Companion(Protocol):
    """What an estimator tells. Times are nanoseconds on the estimator's clock, at the horizon."""

    def started(self, time: int) -> None:
        """Hear that the belief began, or began anew, at ``time``."""
        ...

    def moved(self, start: int, end: int) -> None:
        """Hear that the belief moved from ``start`` to ``end`` by the controls of that time."""
        ...

    def weighed(self, time: int, measured: Measurement, evidence: Evidence, outlier: bool) -> None:
        """Hear that ``measured`` was weighed at ``time``, what it said of the belief, and whether it was an outlier."""
        ...
