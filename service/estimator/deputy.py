"""The deputy: an extended Kalman filter that speaks while not even the fewest particles can be paid for.

Level 4 of the declared order. The filter begins at the particles' moments, takes the same controls and measurements,
and its belief is what is published. The particles are not weighed: they are drawn anew from it where it moves, for
those who look at them, and when there is time again. A second hypothesis, which only they could hold, is lost on the
way: one Gaussian is as wide as all of it was.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from filters.belief import Evidence
from filters.linearised.shadow import LINEARISED, ShadowFilter
from filters.particle import ParticleFilter
from filters.regularization import root
from filters.sensing import Sensor
from service.estimator.binding import Measurement
from service.estimator.carrier import Pose
from service.estimator.vehicle import Vehicle

_REFUSED = Evidence(np.nan, np.nan, accepted=False)


class Deputy:
    """Stands in for a belief's particles; hears of their beginnings as a companion.

    Parameters
    ----------
    vehicle : Vehicle
        The estimator's.
    belief : ParticleFilter
        Whose place it takes.
    seed : int
        Of the particles that are drawn from it.

    Attributes
    ----------
    speaking : bool
        Whether the belief is its own at the moment.
    """

    def __init__(self, vehicle: Vehicle, belief: ParticleFilter[Any], seed: int) -> None:
        self.speaking = False
        self._vehicle = vehicle
        self._belief = belief
        self._seed = seed
        self._filter = ShadowFilter(vehicle.motion, vehicle.slow_states)
        self._carrier = vehicle.carrier(self._filter)
        self._drawn = 0

    def started(self, time: int) -> None:
        """Step down: the particles were drawn for ``time``, and know more."""
        self.speaking = False

    def moved(self, start: int, end: int) -> None:
        """Hear what it has done itself, or need not know."""

    def weighed(self, time: int, measured: Measurement, evidence: Evidence, outlier: bool) -> None:
        """Hear what it has done itself, or need not know."""

    def take_over(self) -> bool:
        """Begin where the particles are, unless it speaks already; ``False`` if they are too wide to linearise at."""
        if not self.speaking:
            moments = self._belief.moments()
            if not self._vehicle.linearisable(moments):
                return False
            self._filter.initialize(moments)
            self.speaking = True
        return True

    def predict(self, control: Any, duration: float) -> None:
        """Move as the particles would, and have them follow: companions look at them for where the belief is."""
        self._filter.predict(control, duration)
        self._draw(self._belief.count)

    def weigh(self, sensor: Sensor[Any], measurement: Any) -> Evidence:
        """Correct by a measurement; refuse what has no linear form, or would leave no Gaussian.

        What the gate keeps out is an outlier, which its evidence tells: it counts as one, not as invalid.
        """
        if type(sensor) not in LINEARISED:
            return _REFUSED
        try:
            evidence = self._filter.weigh(sensor, measurement)
        except (ValueError, np.linalg.LinAlgError):
            return _REFUSED
        return (
            evidence if evidence.accepted or np.isnan(evidence.log_mean) else evidence._replace(accepted=True)
        )

    def at(self, belief_time: int, now: int) -> Pose:
        """Return its belief carried from ``belief_time`` to ``now`` (nanoseconds)."""
        return self._carrier.at(belief_time, now)

    def hand_back(self, count: int) -> None:
        """Draw ``count`` particles from its belief, if it speaks, and be silent."""
        if self.speaking:
            self.speaking = False
            self._draw(count)

    def _draw(self, count: int) -> None:
        """Draw the particles anew.

        A marginalised state's variance given the path is the particles' own and stays: it is taken off here.
        """
        self._drawn += 1
        names, covariance = self._filter.names, self._filter.covariance.copy()
        given_path = {**self._vehicle.motion.conditional_variances, **self._belief.particles.variances}
        for row, name in enumerate(names):
            covariance[row, row] -= given_path.get(name, 0.0)
        random = np.random.Generator(np.random.Philox(key=(self._seed, self._drawn)))
        normals = random.standard_normal((len(names), count))
        drawn = self._filter.mean[:, None] + root(covariance) @ normals
        self._belief.inject(dict(zip(names, drawn, strict=True)), count)
