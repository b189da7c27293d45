"""What a motion model must offer: line 4 of Table 4.3, a draw from p(x_t | u_t, x_{t-1}) per particle."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from filters.kernels.compile import Float32Array
from filters.motion.slow import RandomWalk
from filters.particle_set import ParticleSet

Control = TypeVar("Control", contravariant=True)
Step = TypeVar("Step")


class Motion(Protocol[Control, Step]):
    """The named requirement of a motion model.

    A model is one file: this class, and beside it one kernel over the columns it names. It draws no random
    numbers itself; the filter hands it as many rows of standard normals as it asks for, so that a belief's
    centre can be moved by the same code with rows of zeros.
    """

    @property
    def names(self) -> tuple[str, ...]:
        """Its columns, ``north, east, heading`` first; the first rows of the particle set, in this order."""
        ...

    @property
    def noises(self) -> int:
        """How many standard normals it needs per particle and call."""
        ...

    @property
    def walks(self) -> tuple[RandomWalk, ...]:
        """Those of its columns that wander slowly; the filter walks them."""
        ...

    @property
    def conditional_variances(self) -> Mapping[str, float]:
        """Variance of each marginalised column given a particle's path, the same for all particles."""
        ...

    def start(self) -> None:
        """Forget what was learned since the last start: the particles are drawn anew."""
        ...

    def begin(self, control: Control, duration: float) -> Step:
        """Prepare one prediction: whatever is the same for all particles, once.

        Parameters
        ----------
        control : Control
            What was commanded or measured of the motion over ``duration``.
        duration : float
            Seconds.

        Raises
        ------
        ValueError
            The control is not finite.
        """
        ...

    def move(self, particles: ParticleSet, first: int, last: int, noise: Float32Array, step: Step) -> None:
        """Move the particles ``first`` to ``last`` in place.

        Parameters
        ----------
        particles : ParticleSet
            The set; only its columns are written.
        first, last : int
            Bounds of the block.
        noise : (>= noises, >= last - first) float32
            Standard normals; column 0 belongs to particle ``first``.
        step : Step
            Of :meth:`begin`.
        """
        ...


@runtime_checkable
class Drawing(Protocol):
    """What a motion model of one or two noises offers beside that if one compiled call can draw them and move by them.

    It spares a small set the calls from Python, and threads their waiting for each other between two of them. A model
    that does not offer it is handed its normals block by block, with the same result.
    """

    def move_all(
        self,
        particles: ParticleSet,
        centre: ParticleSet,
        pieces: NDArray[np.int64],
        noise: Float32Array,
        draw: tuple[int, int],
        step: Any,
    ) -> None:
        """Draw for some blocks, and do to them what :meth:`Motion.move` does.

        Parameters
        ----------
        particles : ParticleSet
            The set; only its columns are written.
        centre : ParticleSet
            One particle, moved without noise by whoever moves particle 0.
        pieces : (n, 2) int64
            First and last of each block, or of a part of it.
        noise : (2, >= largest piece) float32
            Room for the normals.
        draw : (int, int)
            Number and key of the draw (:func:`filters.kernels.random.normal_pairs`).
        step : Step
            Of :meth:`Motion.begin`.
        """
        ...


@runtime_checkable
class Reopening(Protocol):
    """What a motion model offers beside that if the states that it marginalises are slow: they can be opened again."""

    @property
    def conditional_variances(self) -> Mapping[str, float]:
        """As of :class:`Motion`."""
        ...

    def reopen(self, variances: Mapping[str, float]) -> None:
        """Add to the variance of every marginalised column what was taken off its means (:mod:`filters.reopening`)."""
        ...
