"""What a sensor model must offer: line 5 of Table 4.3, the likelihood p(z_t | x_t) of every particle."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol, TypeVar, runtime_checkable

from filters.particle_set import ParticleSet

Measurement = TypeVar("Measurement", bound=tuple[float | None, ...], contravariant=True)


class Sensor(Protocol[Measurement]):
    """The named requirement of a sensor model.

    A model is one file: a measurement (a ``NamedTuple`` of finite numbers, ``None`` where not known), this
    class, and beside it one kernel that adds the log likelihood to the log weights.
    """

    def refusal(self, measurement: Measurement) -> str | None:
        """Why this measurement cannot be used (the validity test), or ``None`` if it can."""
        ...

    def weigh(self, particles: ParticleSet, first: int, last: int, measurement: Measurement) -> float:
        """Add the log likelihood, less a constant, to ``particles.log_weights[first:last]``.

        Returns
        -------
        float
            The constant: the log likelihood of a particle that explains the measurement perfectly, a log
            density in the measurement's unit. What is added is therefore never positive, but for rounding.

        Raises
        ------
        KeyError
            The particle set lacks a slow state that the sensor refers to.
        """
        ...

    def innovation(self, centre: Mapping[str, float], measurement: Measurement) -> float:
        """Measured minus expected at the belief's centre, given by the names of its dimensions."""
        ...


@runtime_checkable
class Learner(Protocol[Measurement]):
    """What a sensor model offers beside that if it marginalises a slow state (:class:`filters.motion.learned.Learned`).

    While it weighs a particle it corrects that particle's mean, which is the particle's own; the variance is common to
    all, so it is told once, when all have been weighed.
    """

    def learn(self, particles: ParticleSet, measurement: Measurement, log_mean: float) -> None:
        """Correct ``particles.variances`` by a measurement whose log evidence was ``log_mean``."""
        ...
