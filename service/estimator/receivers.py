"""Satellite receivers whose errors last: each has its error of the last minute as a state of the particles.

A receiver's fixes agree with each other much better than with the truth. Taken for errors that are new every second,
they teach the heading, the gyro and the wheels far less than they know; taken for exact, they make a belief that is
certain of the wrong place. So the part that lasts is a state, marginalised
(:mod:`filters.sensing.biased_position`), and where the vehicle is stays as uncertain as that.

Without odometry nothing tells such an error from the way the vehicle goes, so free vehicles have none
(:mod:`service.estimator.lasting` widens what they publish).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from drivers.sample import SECOND
from filters.belief import Evidence
from filters.kalman import Matrix
from filters.linearised.bank import BATCHED
from filters.linearised.error_parts import ErrorParts, Parts
from filters.linearised.noise_shares import SensorShare
from filters.motion.learned import Learned
from filters.particle import ParticleFilter
from filters.sensing import Position, PositionMeasurement
from filters.sensing.biased_position import Bias, BiasedPosition
from service.config import Configuration
from service.estimator.gaussian import gaussian_of, is_one_place
from service.estimator.ground import GroundVehicle
from service.estimator.measuring import Measurement
from service.estimator.start import receiver_name

PLACE = ("north", "east")

FADING = SECOND // 4
"""Nanoseconds that are gathered before the states decay: they are slow."""

GATHERED = SECOND // 4
"""Nanoseconds of driving that those who learn of an error are moved by at once, at most."""

SPACED = 3 * SECOND // 20
"""Nanoseconds between two readings of another sensor at least that they learn from: of a receiver, every velocity."""

REMEMBERED, DIARY = 5 * SECOND, 7
"""Every so many nanoseconds what was learned is noted, and so many notes are kept: most liars are found out in half a
minute."""

NARROW = 6.0
"""Metres: the spread of a belief that Gaussians can stand for."""

FAR = 16.0
"""Squared distance from the belief, in standard deviations, at which they begin anew as it is."""

PRUDENCE = 0.5
"""What a fix teaches of the error, as a share of what it would if the models were right."""

ANOTHER = 1.5
"""A claim that has changed by this factor is of other circumstances, and so is a part of the error."""


@dataclass
class Receiver:
    """One receiver.

    Attributes
    ----------
    bias : Bias
        Its states.
    model : BiasedPosition or None
        What weighs by its fixes; ``None`` before the first.
    claim : float
        Standard deviation that it claims, metres, as of when that last changed much.
    seated : bool
        Whether the particles' values are of this beginning of the belief.
    learner : ErrorParts
        Who learns what the error is made of.
    parts : Parts
        What it is made of.
    witnessed : dict[str, int]
        When they heard each other sensor last, nanoseconds.
    shown : dict[str, SensorShare]
        What each of these has shown of its variance.
    diary : deque of float64 arrays
        What the learner knew at times, the oldest first.
    """

    bias: Bias
    learner: ErrorParts
    parts: Parts
    model: BiasedPosition | None = None
    claim: float = 0.0
    seated: bool = False
    witnessed: dict[str, int] = field(default_factory=dict[str, int])
    shown: dict[str, SensorShare] = field(default_factory=dict[str, SensorShare])
    diary: deque[Matrix] = field(default_factory=lambda: deque[Matrix](maxlen=DIARY))

    @property
    def variance(self) -> float:
        """Of the part that lasts, m² per axis."""
        return self.parts.lasting * self.claim**2

    def unlearn(self) -> None:
        """Go back to what was known half a minute ago: the rest was learned from lies."""
        if self.diary:
            self.learner.knowledge = self.diary[0]
            self.parts = self.learner.parts
            self.diary.clear()
        self.learner.stop()

    def is_due(self, measured: Measurement, time: int) -> bool:
        """Say whether it is time to learn from another sensor again; it never is from another receiver."""
        if isinstance(measured.model, Position) or time - self.witnessed.get(measured.name, 0) < SPACED:
            return False
        self.witnessed[measured.name] = time
        return True


class Receivers:
    """Splits fixes into what lasts of their errors and what does not; a companion of the belief.

    Parameters
    ----------
    biases : dict of Bias
        Of every receiver, by the name that its fixes have.
    belief : ParticleFilter
        Whose states they are.
    vehicle : GroundVehicle
        Whose odometry tells how it moves.
    placed : bool
        Whether the belief begins at a place that was told, not by a fix.
    """

    def __init__(
        self, biases: dict[str, Bias], vehicle: GroundVehicle, belief: ParticleFilter[Any], placed: bool
    ) -> None:
        motion, slow = vehicle.motion, vehicle.slow_states
        learners = {name: ErrorParts(motion, slow) for name in biases}
        self._receivers = {
            name: Receiver(bias, learners[name], learners[name].parts) for name, bias in biases.items()
        }
        self._vehicle = vehicle
        self._belief = belief
        self._placed = placed
        self._begun = False
        self._gathered = 0
        self._moved: tuple[int, int] | None = None
        self._stood = False
        self._checked = self._noted = 0

    def of(self, name: str) -> Receiver:
        """Return the receiver of a name.

        Raises
        ------
        KeyError
            There is none of that name.
        """
        return self._receivers[name]

    def knows(self, measured: Measurement) -> bool:
        """Say whether a measurement is a fix with an error that is a state."""
        return measured.receiver in self._receivers and measured.lasting > 0.0

    def split(self, measured: Measurement) -> Measurement:
        """Return a fix with the variance of what does not last, for a model that has the rest as a state."""
        value: object = measured.value
        if not (self.knows(measured) and isinstance(value, PositionMeasurement)):
            return measured
        receiver = self.of(measured.receiver or "")
        if receiver.model is None:
            assert isinstance(measured.model, Position)
            receiver.model = BiasedPosition(measured.model, receiver.bias)
        self._claimed(receiver, math.sqrt(measured.lasting))
        sigma = math.sqrt(receiver.parts.fresh * measured.lasting * measured.repeats)
        value = value._replace(sigma_north=sigma, sigma_east=sigma)
        if not receiver.seated:
            self._seat(receiver, value)
        return measured._replace(model=receiver.model, value=value)

    def _claimed(self, receiver: Receiver, claim: float) -> None:
        """Note a claim; the errors of several sources add up, and with other circumstances one comes or goes."""
        if receiver.claim / ANOTHER <= claim <= receiver.claim * ANOTHER:
            return
        before, receiver.claim = receiver.variance, claim
        after = receiver.variance
        if receiver.seated:
            kept = min(1.0, after / before)
            self._change(receiver, kept, max(0.0, after - before) + kept * (before - min(before, after)))

    def _change(self, receiver: Receiver, kept: float, added: float) -> None:
        """Let a share of an error stay, and a variance come to it."""
        variances = self._belief.particles.variances
        for name in receiver.bias:
            self._belief.column(name)[:] *= np.float32(kept)
            variances[name] = kept * kept * variances[name] + added

    def _seat(self, receiver: Receiver, value: PositionMeasurement) -> None:
        """Have every particle take a fix for its own place and the receiver's error.

        A belief that began by a fix has its error: that fix is not to be weighed anew.
        """
        receiver.seated = True
        belief, variances = self._belief, self._belief.particles.variances
        fresh, lasting = float(value.sigma_north or 0.0) ** 2, receiver.variance
        gain = 0.0 if self._placed and not self._begun else lasting / (lasting + fresh)
        places = [belief.column(name) for name in PLACE]
        for name, place, measured in zip(receiver.bias, places, (value.north, value.east), strict=True):
            belief.column(name)[:] = np.float32(gain) * (np.float32(measured) - place)
            variances[name] = (1.0 - gain) * lasting

    @property
    def motion_shares(self) -> tuple[float, float] | None:
        """The shares of the stated variances of turn and distance that fixes have shown; ``None`` before the first."""
        known = [one.learner.motion_shares for one in self._receivers.values() if one.claim > 0.0]
        if not known:
            return None
        turn, distance = zip(*known, strict=True)
        return sum(turn) / len(known), sum(distance) / len(known)

    # --- a companion of the belief --------------------------------------------------------------------------------

    def started(self, time: int) -> None:
        """Have every receiver's error be learned anew: the particles are others."""
        self._begun = any(receiver.seated for receiver in self._receivers.values())
        self._moved = None
        self._checked = time
        for receiver in self._receivers.values():
            receiver.seated = False
            receiver.learner.stop()

    def moved(self, start: int, end: int) -> None:
        """Let the errors become others, little by little."""
        if self._moved is not None and self._vehicle.stands != self._stood:
            self._follow()
        self._stood = self._vehicle.stands
        self._moved = (start if self._moved is None else self._moved[0], end)
        if end - self._moved[0] >= GATHERED:
            self._follow()
        self._gathered += end - start
        if self._gathered >= FADING:
            self._fade()
        if end - self._checked >= SECOND:
            self._checked = end
            self._check()
            self._note(end)

    def _note(self, time: int) -> None:
        """Note what was learned, now and then."""
        due = time - self._noted >= REMEMBERED
        if due:
            self._noted = time
        for receiver in self._receivers.values():
            if receiver.learner.live and (due or not receiver.diary):
                receiver.diary.append(receiver.learner.knowledge)

    def _fade(self) -> None:
        elapsed, self._gathered = self._gathered / SECOND, 0
        for receiver in self._receivers.values():
            if receiver.seated:
                kept = math.exp(-elapsed / receiver.parts.duration)
                self._change(receiver, kept, (1.0 - kept * kept) * receiver.variance)

    def _follow(self) -> None:
        """Have those who learn go the way that was gathered."""
        if self._moved is None:
            return
        (start, end), self._moved = self._moved, None
        control = None if self._stood else self._vehicle.control(start, end)
        for receiver in self._receivers.values():
            receiver.learner.predict(control, (end - start) / SECOND, receiver.claim)

    def _check(self) -> None:
        """See whether those who learn still are of the belief, and take what they have learned."""
        narrow = is_one_place(self._belief.moments(), NARROW)
        for receiver in self._receivers.values():
            learner = receiver.learner
            if not narrow or not receiver.seated:
                learner.stop()
                continue
            learner.forget(1.0)
            receiver.parts = learner.parts
            given_path = self._vehicle.motion.conditional_variances | self._errors(receiver)
            mean, covariance = gaussian_of(self._belief, given_path, receiver.bias)
            if learner.live:
                away = mean[:2] - learner.mean()[:2]
                own: Matrix = covariance[:2, :2] + learner.bank.covariance[:, :2, :2].mean(axis=0)
                if float(away @ np.linalg.solve(own, away)) < FAR:
                    continue
            learner.begin(mean, covariance)

    def _errors(self, receiver: Receiver) -> dict[str, float]:
        return {name: self._belief.particles.variances[name] for name in receiver.bias}

    def weighed(self, time: int, measured: Measurement, evidence: Evidence, outlier: bool) -> None:
        """Have those who learn hear a measurement, as it was stated."""
        if type(measured.model) not in BATCHED:
            return
        for name, receiver in self._receivers.items():
            if not receiver.learner.live:
                continue
            if name == measured.receiver and isinstance(measured.model, Position):
                self._follow()
                variance = measured.lasting * measured.repeats
                weight = 0.0 if self._stood else PRUDENCE / measured.repeats
                receiver.learner.hear(measured.model, measured.value, variance, measured.log_outlier, weight)
            elif receiver.is_due(measured, time):
                self._follow()
                weight = 0.0 if self._stood else PRUDENCE / measured.repeats
                own = receiver.shown.setdefault(measured.name, SensorShare())
                receiver.learner.witness(measured.model, measured.value, measured.log_outlier, weight, own)

    # --- who disturbs it ------------------------------------------------------------------------------------------

    def distrusted(self, measured: Measurement) -> None:
        """Forget the error of a receiver that is not believed: when it is believed again it will be another."""
        if self.knows(measured):
            receiver = self.of(measured.receiver or "")
            receiver.unlearn()
            self._change(receiver, 0.0, receiver.variance)

    @contextmanager
    def kept(self) -> Generator[None]:
        """Have every particle that is moved meanwhile expect the same fixes as before."""
        places = [self._belief.column(name).copy() for name in PLACE]
        yield
        for receiver in self._receivers.values():
            for name, place, before in zip(receiver.bias, PLACE, places, strict=True):
                self._belief.column(name)[:] += before - self._belief.column(place)


def biases_of(configuration: Configuration) -> dict[str, Bias]:
    """Return the states of every receiver of a vehicle whose odometry tells how it moves, by the receiver's name.

    One of unknown delay has none: along the way both look the same, and the particles have the delay as samples only.
    """
    if not configuration.honesty.lasting_errors or configuration.vehicle.motion == "constant_velocity":
        return {}
    names = [
        receiver_name(sensor)
        for sensor in configuration.sensor
        if sensor.kind == "position" and sensor.correlation_s != 0.0 and "delay" not in sensor.estimate
    ]
    return {name: Bias(f"{name}/north", f"{name}/east") for name in names}


def learned(biases: dict[str, Bias]) -> list[Learned]:
    """Return them as slow states; how large they are is known with the first fix."""
    return [Learned(name, 0.0, 0.0) for bias in biases.values() for name in bias]
