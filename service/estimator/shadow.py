"""The shadow: an extended Kalman filter on the very samples that the particle filter gets.

It is told of every stretch and every measurement (:class:`~service.estimator.companion.Companion`), starts from the
particles' own moments, and is carried to now by the same output predictor. Whatever differs between the two tracks is
the filters' doing. It begins once the heading is known well enough to linearise about: an extended Kalman filter
cannot start from a heading that could be any.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from drivers.sample import SECOND
from filters.belief import Evidence
from filters.linearised.shadow import LINEARISED, ShadowFilter
from service.estimator.binding import Measurement
from service.estimator.carrier import Pose
from service.estimator.companion import Watched
from service.estimator.vehicle import Vehicle


class Shadow:
    """An extended Kalman filter beside an estimator's belief.

    Parameters
    ----------
    vehicle : Vehicle
        The estimator's; its controls are read.
    belief : Watched
        The estimator's, to start from.

    Attributes
    ----------
    accepted, gated, unsupported : Counter[str]
        Measurements by sensor: weighed in; kept out by the gate; of a model that has no linearised counterpart.
    failure : str
        Why it has stopped, if it has: its numbers were no longer a Gaussian's.
    """

    def __init__(self, vehicle: Vehicle, belief: Watched) -> None:
        self._vehicle = vehicle
        self._belief = belief
        self._filter = ShadowFilter(vehicle.motion, vehicle.slow_states)
        self._carrier = vehicle.carrier(self._filter)
        self._time: int | None = None
        self._running = False
        self.accepted: Counter[str] = Counter()
        self.gated: Counter[str] = Counter()
        self.unsupported: Counter[str] = Counter()
        self.failure = ""

    def started(self, time: int) -> None:
        """Wait for the belief, which began at ``time``, to know its heading."""
        self._time = time
        self._running = False
        self.failure = ""

    def moved(self, start: int, end: int) -> None:
        """Predict from ``start`` to ``end``."""
        self._time = end
        if not self._running:
            return
        try:
            self._filter.predict(self._vehicle.control(start, end), (end - start) / SECOND)
        except ValueError as error:
            self._fail(error)

    def weighed(self, time: int, measured: Measurement, evidence: Evidence, outlier: bool) -> None:
        """Correct by the same measurement, if it passes the gate; the particles' verdict on it is not used."""
        if not self._running:
            return
        if type(measured.model) not in LINEARISED:
            self.unsupported[measured.name] += 1
            return
        try:
            said = self._filter.weigh(measured.model, measured.value)
        except (ValueError, np.linalg.LinAlgError) as error:
            self._fail(error)
            return
        (self.accepted if said.accepted else self.gated)[measured.name] += 1

    def at(self, now: int) -> Pose | None:
        """Return its belief carried to ``now`` (nanoseconds); ``None`` before it has begun and after it failed."""
        if self._time is None or self.failure:
            return None
        if not self._running and not self._begin():
            return None
        return self._carrier.at(self._time, now)

    def _begin(self) -> bool:
        moments = self._belief.glance()
        if not self._vehicle.linearisable(moments):
            return False
        self._filter.initialize(moments)
        self._running = True
        return True

    def _fail(self, error: Exception) -> None:
        self.failure = str(error)
        self._running = False
