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
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from filters.belief import Evidence
from filters.motion.learned import Learned
from filters.particle import ParticleFilter
from filters.sensing import Position, PositionMeasurement
from filters.sensing.biased_position import Bias, BiasedPosition
from service.config import Configuration
from service.estimator.measuring import Measurement
from service.estimator.start import receiver_name
from service.estimator.track import SECOND

DURATION = 60.0
"""Seconds over which reflections and atmosphere change what a receiver says."""

PLACE = ("north", "east")

FADING = SECOND // 4
"""Nanoseconds that are gathered before the states decay: they are slow."""

FRESH = 0.2
"""Share of a receiver's variance that does not last, while nothing better is known."""

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
    """

    bias: Bias
    model: BiasedPosition | None = None
    claim: float = 0.0
    seated: bool = False

    @property
    def variance(self) -> float:
        """Of the part that lasts, m² per axis."""
        return (1.0 - FRESH) * self.claim**2


class Receivers:
    """Splits fixes into what lasts of their errors and what does not; a companion of the belief.

    Parameters
    ----------
    biases : dict of Bias
        Of every receiver, by the name that its fixes have.
    belief : ParticleFilter
        Whose states they are.
    placed : bool
        Whether the belief begins at a place that was told, not by a fix.
    """

    def __init__(self, biases: dict[str, Bias], belief: ParticleFilter[Any], placed: bool) -> None:
        self._receivers = {name: Receiver(bias) for name, bias in biases.items()}
        self._belief = belief
        self._placed = placed
        self._begun = False
        self._gathered = 0

    def knows(self, measured: Measurement) -> bool:
        """Say whether a measurement is a fix with an error that is a state."""
        return measured.receiver in self._receivers and measured.lasting > 0.0

    def split(self, measured: Measurement) -> Measurement:
        """Return a fix with the variance of what does not last, for a model that has the rest as a state."""
        value: object = measured.value
        if not (self.knows(measured) and isinstance(value, PositionMeasurement)):
            return measured
        receiver = self._receivers[measured.receiver or ""]
        if receiver.model is None:
            assert isinstance(measured.model, Position)
            receiver.model = BiasedPosition(measured.model, receiver.bias)
        self._claimed(receiver, math.sqrt(measured.lasting))
        sigma = math.sqrt(FRESH * measured.lasting * measured.repeats)
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

    # --- a companion of the belief --------------------------------------------------------------------------------

    def started(self, time: int) -> None:
        """Have every receiver's error be learned anew: the particles are others."""
        self._begun = any(receiver.seated for receiver in self._receivers.values())
        for receiver in self._receivers.values():
            receiver.seated = False

    def moved(self, start: int, end: int) -> None:
        """Let the errors become others, little by little."""
        self._gathered += end - start
        if self._gathered < FADING:
            return
        kept = math.exp(-self._gathered / SECOND / DURATION)
        self._gathered = 0
        for receiver in self._receivers.values():
            if receiver.seated:
                self._change(receiver, kept, (1.0 - kept * kept) * receiver.variance)

    def weighed(self, time: int, measured: Measurement, evidence: Evidence, outlier: bool) -> None:
        """Nothing: what was weighed was taught by the model itself."""

    # --- who disturbs it ------------------------------------------------------------------------------------------

    def distrusted(self, measured: Measurement) -> None:
        """Forget the error of a receiver that is not believed: when it is believed again it will be another."""
        if self.knows(measured):
            receiver = self._receivers[measured.receiver or ""]
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
    """Return the states of every receiver of a vehicle whose odometry tells how it moves, by the receiver's name."""
    if not configuration.honesty.lasting_errors or configuration.vehicle.motion == "constant_velocity":
        return {}
    names = [
        receiver_name(sensor)
        for sensor in configuration.sensor
        if sensor.kind == "position" and sensor.correlation_s != 0.0
    ]
    return {name: Bias(f"{name}/north", f"{name}/east") for name in names}


def learned(biases: dict[str, Bias]) -> list[Learned]:
    """Return them as slow states; how large they are is known with the first fix."""
    return [Learned(name, 0.0, 0.0) for bias in biases.values() for name in bias]
