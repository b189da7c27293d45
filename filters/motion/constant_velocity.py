"""Constant velocity: a vehicle or a tag of which nothing is measured but where it is, in two or three dimensions.

White-noise acceleration (Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and Navigation",
2001, section 6.2.2): on each axis, over a time T and with a density q,

    position' = position + velocity T + w,   velocity' = velocity + u,
    cov(w, u) = q² [[T³/3, T²/2], [T²/2, T]].

Given a particle's path the velocity is linear and Gaussian, so it is not sampled but *marginalised* (Rao-Blackwell;
Schön, Gustafsson, Nordlund, "Marginalized particle filters for mixed linear/nonlinear state-space models", IEEE TSP
53(7), 2005). Each particle carries its mean; the variance is the same for all particles and axes.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy import float32
from numpy.typing import NDArray

from filters.kernels.compile import Float32Array, kernel
from filters.motion.slow import RandomWalk
from filters.particle_set import ParticleSet

VELOCITY_NORTH = "velocity_north"
VELOCITY_EAST = "velocity_east"
VELOCITY_DOWN = "velocity_down"
DOWN = "down"

_PLANE, _SPACE = 2, 3
_COLUMNS = {
    _PLANE: ("north", "east", "heading", VELOCITY_NORTH, VELOCITY_EAST),
    _SPACE: ("north", "east", "heading", VELOCITY_NORTH, VELOCITY_EAST, DOWN, VELOCITY_DOWN),
}


class FreeControl(NamedTuple):
    """No control: what moves the vehicle is not measured."""


FREE = FreeControl()


class ConstantVelocityStep(NamedTuple):
    """One prediction, ready for the kernel: the same numbers for every particle."""

    duration: float
    sigma: float
    gain: float
    vertical_sigma: float
    vertical_gain: float


class Axis:
    """The marginalised velocity of one axis, or of several that are alike: its variance given a particle's path.

    Parameters
    ----------
    density : float
        Of the acceleration, m/s² per √Hz (m/s per √s).
    velocity_sigma : float
        What the velocity may be at the start, m/s.
    """

    def __init__(self, density: float, velocity_sigma: float) -> None:
        self.density: Final = density
        self.velocity_sigma: Final = velocity_sigma
        self.variance = velocity_sigma**2

    def start(self) -> None:
        """Forget what the paths told."""
        self.variance = self.velocity_sigma**2

    def step(self, duration: float) -> tuple[float, float]:
        """Return the displacement's standard deviation and what the velocity learns from a draw; update the variance.

        With P the velocity's variance, S = T² P + q² T³/3 is that of the displacement and C = T P + q² T²/2 their
        covariance; a displacement of z standard deviations tells the velocity C / √S z, and leaves P + q² T - C² / S.
        """
        noise = self.density**2
        displaced = duration**2 * self.variance + noise * duration**3 / 3.0
        shared = duration * self.variance + noise * duration**2 / 2.0
        if not displaced > 0.0:
            self.variance += noise * duration
            return 0.0, 0.0
        sigma = math.sqrt(displaced)
        gain = shared / sigma
        self.variance = max(0.0, self.variance + noise * duration - gain * gain)
        return sigma, gain


class ConstantVelocity:
    """Constant velocity with white-noise acceleration and marginalised velocities.

    For each axis, with m a particle's mean velocity, P the variance that all share, and z a standard normal::

        S = T² P + q² T³/3,  C = T P + q² T²/2
        position += m T + √S z,   m += C / √S z,   P += q² T - C² / S

    The displacement is drawn with the velocity's uncertainty in it, and the draw is then taken as a measurement of the
    velocity. Composed over any times it is exact: the densities do not depend on the rate of the ticks. The heading's
    column is kept where it is: a point has none.

    Parameters
    ----------
    acceleration_noise : float
        Of the horizontal acceleration, m/s² per √Hz: after T seconds the velocity is uncertain by this times √T.
    velocity_sigma : float
        What the velocity may be at the start on each horizontal axis, m/s, beyond the spread of the particles' own.
    dimensions : int
        2, or 3 with ``down`` and ``velocity_down``.
    vertical_noise, vertical_sigma : float, optional
        The same for the vertical axis; without them as the horizontal ones.

    Raises
    ------
    ValueError
        A density or sigma that is negative or not finite, or other than two or three dimensions.
    """

    walks: tuple[RandomWalk, ...] = ()

    def __init__(
        self,
        acceleration_noise: float,
        velocity_sigma: float = 1.0,
        dimensions: int = 2,
        vertical_noise: float | None = None,
        vertical_sigma: float | None = None,
    ) -> None:
        if dimensions not in _COLUMNS:
            raise ValueError(f"constant velocity: dimensions must be 2 or 3, got {dimensions}")
        vertical = (
            acceleration_noise if vertical_noise is None else vertical_noise,
            velocity_sigma if vertical_sigma is None else vertical_sigma,
        )
        values = (acceleration_noise, velocity_sigma, *vertical)
        names = ("acceleration_noise", "velocity_sigma", "vertical_noise", "vertical_sigma")
        for name, value in zip(names, values, strict=True):
            if not 0.0 <= value < math.inf:
                raise ValueError(f"constant velocity: {name} must be finite and not negative, got {value}")
        self.dimensions: Final = dimensions
        self.names: Final = _COLUMNS[dimensions]
        self.noises: Final = dimensions
        self._horizontal = Axis(acceleration_noise, velocity_sigma)
        self._vertical = Axis(*vertical)

    @property
    def acceleration_noise(self) -> float:
        """Density of the horizontal acceleration."""
        return self._horizontal.density

    @property
    def vertical_noise(self) -> float:
        """Density of the vertical acceleration."""
        return self._vertical.density

    def start(self) -> None:
        """Forget what was learned of the velocity."""
        self._horizontal.start()
        self._vertical.start()

    @property
    def conditional_variances(self) -> dict[str, float]:
        """Variances of the velocities given a particle's path; the spread of the particles' means comes on top."""
        horizontal = self._horizontal.variance
        variances = {VELOCITY_NORTH: horizontal, VELOCITY_EAST: horizontal}
        if self.dimensions == _SPACE:
            variances[VELOCITY_DOWN] = self._vertical.variance
        return variances

    def begin(self, control: FreeControl, duration: float) -> ConstantVelocityStep:
        """Prepare one prediction and update the shared variances; see :class:`filters.motion.Motion`."""
        return ConstantVelocityStep(
            duration, *self._horizontal.step(duration), *self._vertical.step(duration)
        )

    def move(
        self, particles: ParticleSet, first: int, last: int, noise: Float32Array, step: ConstantVelocityStep
    ) -> None:
        """Move a block of particles in place; see :class:`filters.motion.Motion`."""
        columns = particles.columns
        duration, sigma, gain, vertical_sigma, vertical_gain = step
        glide.direct(columns, 0, 3, noise, 0, first, last, duration, sigma, gain)
        glide.direct(columns, 1, 4, noise, 1, first, last, duration, sigma, gain)
        if self.dimensions == _SPACE:
            glide.direct(columns, 5, 6, noise, 2, first, last, duration, vertical_sigma, vertical_gain)


def carried(
    mean: NDArray[np.float64],
    covariance: NDArray[np.float64],
    densities: NDArray[np.float64],
    duration: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a Gaussian of positions, then velocities, carried for ``duration`` seconds: exact, for it is linear.

    Parameters
    ----------
    mean : (2 n,) float64
        n positions, m, then their n velocities, m/s.
    covariance : (2 n, 2 n) float64
        Of these.
    densities : (n,) float64
        Of each axis' acceleration, m/s² per √Hz.
    duration : float
        Seconds.

    Returns
    -------
    tuple of (2 n,) and (2 n, 2 n) float64
        F m and F C Fᵀ + Q.
    """
    size = densities.size
    moved, spread = mean.copy(), covariance.copy()
    moved[:size] += duration * mean[size:]
    spread[:size] += duration * spread[size:]
    spread[:, :size] += duration * spread[:, size:]
    add_acceleration(spread, np.arange(size), np.arange(size, 2 * size), np.square(densities), duration)
    return moved, spread


def add_acceleration(
    covariance: NDArray[np.float64],
    positions: NDArray[np.int64],
    velocities: NDArray[np.int64],
    variances: NDArray[np.float64],
    duration: float,
) -> None:
    """Add to a covariance what white-noise acceleration does in ``duration`` seconds: Q.

    Parameters
    ----------
    covariance : (d, d) float64
        Written to.
    positions, velocities : (n,) int
        The rows of each axis.
    variances : (n,) float64
        Squared density of each axis' acceleration.
    duration : float
        Seconds.
    """
    covariance[positions, positions] += duration**3 / 3.0 * variances
    covariance[positions, velocities] += duration**2 / 2.0 * variances
    covariance[velocities, positions] += duration**2 / 2.0 * variances
    covariance[velocities, velocities] += duration * variances


@kernel(
    "void(float32[:, ::1], int64, int64, float32[:, ::1], int64, int64, int64, float32, float32, float32)"
)
def glide(
    columns: Float32Array,
    position_row: int,
    velocity_row: int,
    noise: Float32Array,
    noise_row: int,
    first: int,
    last: int,
    duration: float,
    sigma: float,
    gain: float,
) -> None:
    """Move every particle of a block along one axis, and learn its velocity from the draw."""
    position = columns[position_row, first:last]
    velocity = columns[velocity_row, first:last]
    normal = noise[noise_row]
    for i in range(last - first):
        v = velocity[i]
        z = normal[i]
        position[i] += float32(duration * v) + float32(sigma * z)
        velocity[i] = v + float32(gain * z)
