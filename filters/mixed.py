"""What the marginalised filter asks of a motion and of a sensor whose model is partly linear.

With nonlinear states x in the particles and linear ones l, which are Gaussian once a particle's path is given::

    v = a + A l + w,   w ~ N(0, Q)         the increment that the motion draws
    x' = f(x, v)
    l' = F l + d + r,  r ~ N(0, R)
    z = h(x) + C l + e,  e ~ N(0, S)

The matrices are the same for all particles; f and h work on columns. The filter: :mod:`filters.marginal`.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol, TypeVar

import numpy as np

from filters.kalman import Matrix, require_finite, require_shape
from filters.kernels.compile import Float32Array
from filters.particle_set import ParticleSet

ControlIn = TypeVar("ControlIn", contravariant=True)
Measurement = TypeVar("Measurement", contravariant=True)


class MixedStep(NamedTuple):
    """One prediction, for k increments and l linear states: the same numbers for every particle.

    Attributes
    ----------
    offset : (k,) float64
        a, the increment as far as the control says it.
    coupling : (k, l) float64
        A, the linear states' part in it.
    noise : (k, k) float64
        Q.
    transition : (l, l) float64
        F.
    drift : (l,) float64
        d.
    linear_noise : (l, l) float64
        R.
    """

    offset: Matrix
    coupling: Matrix
    noise: Matrix
    transition: Matrix
    drift: Matrix
    linear_noise: Matrix


class MixedMotion(Protocol[ControlIn]):
    """The named requirement of a motion model."""

    @property
    def nonlinear(self) -> tuple[str, ...]:
        """Columns that are sampled, the first rows of the particle set."""
        ...

    @property
    def linear(self) -> tuple[str, ...]:
        """Columns of the linear states' means, the rows that follow."""
        ...

    @property
    def angles(self) -> tuple[int, ...]:
        """Which of the nonlinear columns are angles, radians."""
        ...

    def begin(self, control: ControlIn, duration: float) -> MixedStep:
        """Prepare one prediction over ``duration`` seconds."""
        ...

    def move(self, particles: ParticleSet, first: int, last: int, increments: Float32Array) -> None:
        """Move the nonlinear columns of the particles ``first`` to ``last``: x' = f(x, v).

        ``increments``, (k, >= last - first) float32, holds v; its column 0 belongs to particle ``first``.
        """
        ...


class MixedObservation(NamedTuple):
    """One measurement, the same for every particle.

    Attributes
    ----------
    measured : (m,) float64
        z; NaN among its components means that this one was not measured.
    coupling : (m, l) float64
        C.
    noise : (m, m) float64
        S.
    angles : tuple of int
        Components that are angles: their innovations are taken in [-pi, pi].
    """

    measured: Matrix
    coupling: Matrix
    noise: Matrix
    angles: tuple[int, ...] = ()


class MixedSensor(Protocol[Measurement]):
    """The named requirement of a sensor model that sees linear states."""

    def begin(self, measurement: Measurement) -> MixedObservation:
        """Prepare one measurement."""
        ...

    def expect(
        self, particles: ParticleSet, first: int, last: int, measurement: Measurement, expected: Float32Array
    ) -> None:
        """Write h(x) of the particles ``first`` to ``last`` into ``expected``, (m, >= last - first) float32.

        Finite also where nothing was measured; its column 0 belongs to particle ``first``.
        """
        ...


def check_step(step: MixedStep, linear: int) -> None:
    """Check what a motion says of one prediction, for a number of linear states.

    Raises
    ------
    ValueError
        Shapes that do not fit, or a value that is not finite.
    """
    increments = step.offset.size
    shapes = {
        "offset": (increments,),
        "coupling": (increments, linear),
        "noise": (increments, increments),
        "transition": (linear, linear),
        "drift": (linear,),
        "linear_noise": (linear, linear),
    }
    for matrix, (name, shape) in zip(step, shapes.items(), strict=True):
        require_shape(f"marginal prediction: {name}", matrix, shape)
    require_finite("marginal prediction", *step)


def check_observation(observation: MixedObservation, linear: int) -> None:
    """Check what a sensor says of one measurement, for a number of linear states.

    Raises
    ------
    ValueError
        Shapes that do not fit, or a value that is not finite; a component that was not measured is NaN.
    """
    measured, coupling, noise, _ = observation
    require_shape("marginal correction: coupling", coupling, (measured.size, linear))
    require_shape("marginal correction: noise", noise, (measured.size, measured.size))
    require_finite("marginal correction", measured[~np.isnan(measured)], coupling, noise)
