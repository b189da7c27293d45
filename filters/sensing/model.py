"""What a sensor model must offer: line 5 of Table 4.3, the likelihood p(z_t | x_t) of every particle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from filters.kernels.compile import Float32Array
from filters.particle_set import ParticleSet

Float64Array = NDArray[np.float64]
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


class Account(NamedTuple):
    """What is to be written down while several measurements are weighed by, one after the other.

    Attributes
    ----------
    rows : int
        How many measurements there are.
    centre : (dimension, 1) float32
        The belief's centre, which innovations are measured from.
    stride : int
        Every how manieth log weight is kept.
    samples : (at least rows, sampled) float32
        Row m takes those log weights as they are after measurement m (:func:`filters.kernels.evidence.thin`).
    said : (at least rows, 2) float64
        Row m takes what :meth:`Sensor.weigh` returns for it and what :meth:`Sensor.innovation` says.
    """

    rows: int
    centre: Float32Array
    stride: int
    samples: Float32Array
    said: Float64Array


@runtime_checkable
class Batch(Protocol[Measurement]):
    """What a sensor model offers beside that if one compiled call can weigh by several of its measurements.

    It spares a small set much of its time: a call from Python costs as much as the arithmetic of hundreds of particles.
    A model that does not offer it is asked for one measurement after the other, with the same result.
    """

    def tabulate(self, measurements: Sequence[Measurement]) -> list[float] | None:
        """Return eight numbers of each for the call, one after the other; ``None`` if one is refused."""
        ...

    def weigh_all(
        self, particles: ParticleSet, first: int, last: int, numbers: Float64Array, account: Account
    ) -> float:
        """Do what :meth:`Sensor.weigh` does, for one measurement after the other.

        Parameters
        ----------
        particles : ParticleSet
            Its ``log_weights`` are written, from ``first`` to ``last``.
        first, last : int
            Bounds of the particles.
        numbers : (at least rows, 8) float64
            Of :meth:`tabulate`.
        account : Account
            Where the rest is written; ``said`` by every caller, with the same numbers.

        Returns
        -------
        float
            The largest log weight among these particles, as it is then.
        """
        ...
