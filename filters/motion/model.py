"""What a motion model must offer: line 4 of Table 4.3, a draw from p(x_t | u_t, x_{t-1}) per particle."""

from __future__ import annotations

from typing import Protocol, TypeVar

from filters.kernels.compile import Float32Array
from filters.motion.slow import RandomWalk
from filters.particle_set import ParticleSet

Control = TypeVar("Control", contravariant=True)


class Motion(Protocol[Control]):
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

    def move(
        self,
        particles: ParticleSet,
        first: int,
        last: int,
        noise: Float32Array,
        control: Control,
        duration: float,
    ) -> None:
        """Move the particles ``first`` to ``last`` in place.

        Parameters
        ----------
        particles : ParticleSet
            The set; only its columns are written.
        first, last : int
            Bounds of the block.
        noise : (>= noises, >= last - first) float32
            Standard normals; column 0 belongs to particle ``first``.
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
