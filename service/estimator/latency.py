"""What a stated latency is off by: learned along the way, and taken off the fixes that the belief is weighed by.

A latency that was stated is known to some hundredths of a second. A companion follows the belief with a few Gaussians
for each such receiver (:mod:`filters.linearised.latency`) and hears its fixes as they were stated. The belief takes
them as far ahead on the way as they are late beyond that by the best that is known, and what is published is wider by
what is still unknown of it (:mod:`service.estimator.lasting`).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from drivers.sample import SECOND
from filters.belief import Evidence
from filters.kalman import Matrix
from filters.linearised.bank import BATCHED
from filters.linearised.latency import LATENCY, Late, Lateness
from filters.particle import ParticleFilter
from filters.sensing import Position, PositionMeasurement, Velocity
from service.config import Configuration
from service.estimator.gaussian import gaussian_of, is_one_place
from service.estimator.ground import GroundVehicle
from service.estimator.measuring import Measurement
from service.estimator.vehicle import Vehicle

GATHERED = SECOND // 4
"""Nanoseconds of driving that the Gaussians are moved by at once, at most."""

NARROW = 3.0
"""Metres: the spread of a belief that Gaussians can stand for."""

FAR = 16.0
"""Squared distance from the belief, in standard deviations, at which they begin anew as it is."""

PRUDENCE = 0.5
"""What a fix teaches of the noises, as a share of what it would if the models were right."""


class Receiver:
    """One receiver: who learns how late it is, the model of its fixes with that, and what of its error lasts (m²)."""

    def __init__(self, name: str, learner: Lateness, model: Position) -> None:
        self._link = _link(name)
        self.learner = learner
        self.model = Position(
            model.sigma, outliers=model.outliers, span=model.span, lever=model.lever, delay=LATENCY
        )
        self.claimed = 0.0
        self.witnessed: dict[str, int] = {}
        self._velocities: dict[str, Velocity] = {}

    def model_of(self, measured: Measurement) -> Any:
        """Return the model to witness a measurement by: velocities of this receiver are as late as its fixes."""
        model: object = measured.model
        if measured.timing <= 0.0 or not isinstance(model, Velocity) or _link(measured.name) != self._link:
            return model
        if measured.name not in self._velocities:
            self._velocities[measured.name] = Velocity(
                model.sigma, outliers=model.outliers, span=model.span, scale=model.scale, delay=LATENCY
            )
        return self._velocities[measured.name]


class Latency:
    """Learns how late receivers are; a :class:`~service.estimator.companion.Companion`.

    Parameters
    ----------
    vehicle : GroundVehicle
        Whose odometry tells how it moves.
    belief : ParticleFilter
        What the Gaussians begin as.
    """

    def __init__(self, vehicle: GroundVehicle, belief: ParticleFilter[Any]) -> None:
        self._vehicle = vehicle
        self._belief = belief
        self._receivers: dict[str, Receiver] = {}
        self._moved: tuple[int, int] | None = None
        self._stood = False
        self._checked = 0

    def late(self, measured: Measurement) -> Late:
        """Return what is known of the latency beyond what was stated, with its mean as far as fixes are moved by it."""
        receiver = self._receivers.get(measured.name)
        if receiver is None:
            return Late(0.0, measured.timing)
        late = receiver.learner.late
        return late if receiver.learner.live else Late(0.0, math.hypot(late.mean, late.sigma))

    def punctual(self, measured: Measurement) -> Measurement:
        """Return a fix as far ahead on the way as it is late beyond what was stated."""
        value: object = measured.value
        if not (measured.timing > 0.0 and isinstance(value, PositionMeasurement)):
            return measured
        receiver = self._receivers.get(measured.name)
        if receiver is None or not receiver.learner.live:
            return measured
        way = receiver.learner.late.mean * value.speed
        heading = float(receiver.learner.mean()[2])
        return measured._replace(
            value=value._replace(
                north=value.north + way * math.cos(heading), east=value.east + way * math.sin(heading)
            )
        )

    # --- a companion of the belief --------------------------------------------------------------------------------

    def started(self, time: int) -> None:
        """Have the Gaussians wait for the belief to be one place; how late the receivers are is kept."""
        self._moved = None
        self._checked = time
        for receiver in self._receivers.values():
            receiver.learner.stop()

    def moved(self, start: int, end: int) -> None:
        """Gather the way, and see once a second whether the Gaussians still are of the belief."""
        if not self._receivers:
            return
        if self._moved is not None and self._vehicle.stands != self._stood:
            self._follow()
        self._stood = self._vehicle.stands
        self._moved = (start if self._moved is None else self._moved[0], end)
        if end - self._moved[0] >= GATHERED:
            self._follow()
        if end - self._checked >= SECOND:
            self._checked = end
            self._follow()
            self._check()

    def _follow(self) -> None:
        """Have those who learn go the way that was gathered."""
        if self._moved is None:
            return
        (start, end), self._moved = self._moved, None
        control = None if self._stood else self._vehicle.control(start, end)
        for receiver in self._receivers.values():
            receiver.learner.predict(control, (end - start) / SECOND, receiver.claimed)

    def _check(self) -> None:
        narrow = is_one_place(self._belief.moments(), NARROW)
        mean, covariance = gaussian_of(self._belief, self._vehicle.motion.conditional_variances)
        for receiver in self._receivers.values():
            learner = receiver.learner
            if not narrow:
                learner.stop()
                continue
            if learner.live:
                away = mean[:2] - learner.mean()[:2]
                own: Matrix = covariance[:2, :2] + learner.bank.covariance[:, :2, :2].mean(axis=0)
                if float(away @ np.linalg.solve(own + 0.01 * np.eye(2), away)) < FAR:
                    continue
            learner.begin(mean, covariance, receiver.claimed)

    def weighed(self, time: int, measured: Measurement, evidence: Evidence, outlier: bool) -> None:
        """Have those who learn hear a measurement, as it was stated."""
        if type(measured.model) not in BATCHED:
            return
        own = self._receiver_of(measured)
        if own is not None:
            self._follow()
            own.claimed = 0.0 if measured.independent else measured.lasting
            weight = 0.0 if self._stood else PRUDENCE / measured.repeats
            own.learner.hear(own.model, measured.value, measured.log_outlier, weight)
            return
        for receiver in self._receivers.values():
            if isinstance(measured.model, Position) or not self._is_due(receiver, measured, time):
                continue
            self._follow()
            receiver.learner.witness(receiver.model_of(measured), measured.value)

    def _receiver_of(self, measured: Measurement) -> Receiver | None:
        """Return who says a fix whose stated latency is known only so well; one that is new becomes known."""
        model: object = measured.model
        if measured.timing <= 0.0 or not isinstance(model, Position) or model.delay is not None:
            return None
        if measured.name not in self._receivers:
            learner = Lateness(self._vehicle.motion, self._vehicle.slow_states, measured.timing)
            self._receivers[measured.name] = Receiver(measured.name, learner, model)
        return self._receivers[measured.name]

    @staticmethod
    def _is_due(receiver: Receiver, measured: Measurement, time: int) -> bool:
        if time - receiver.witnessed.get(measured.name, 0) < GATHERED:
            return False
        receiver.witnessed[measured.name] = time
        return True


def _link(name: str) -> str:
    """Return what the name of a measurement has beside its kind."""
    return name.partition("/")[2]


def latency_of(configuration: Configuration, vehicle: Vehicle, belief: ParticleFilter[Any]) -> Latency | None:
    """Return who learns how late receivers are; ``None`` where nothing tells it, or that is switched off."""
    stated = any(sensor.kind == "position" and sensor.delay_ms > 0.0 for sensor in configuration.sensor)
    if not (configuration.honesty.noise_learning and stated and isinstance(vehicle, GroundVehicle)):
        return None
    return Latency(vehicle, belief)
