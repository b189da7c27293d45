"""Unicycle: a ground vehicle that rolls forward and turns, with the errors of its odometer and its gyro as states.

The errors are not sampled but *marginalised* (Rao-Blackwell; Schön, Gustafsson, Nordlund, "Marginalized particle
filters for mixed linear/nonlinear state-space models", IEEE TSP 53(7), 2005): given a particle's path, gyro bias b and
odometry scale s are linear and Gaussian. Each particle carries its own means, and because the coefficients of b and s
(the duration and the distance) are the same for all particles, so are the two variances. Sampled as mere columns, such
states freeze: resampling leaves a few ancestors' values, and their spread says nothing of what is known.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy import float32
from numpy.typing import NDArray

from filters.kernels.compile import Float32Array, kernel
from filters.kernels.elementary import sincos, wrapped
from filters.kernels.random import normal_pairs
from filters.motion.slow import RandomWalk
from filters.particle_set import ParticleSet

_STILL: Float32Array = np.zeros((2, 1), np.float32)
"""The noise that the centre is moved with."""

GYRO_BIAS = "gyro_bias"
ODOMETRY_SCALE = "odometry_scale"


class UnicycleControl(NamedTuple):
    """What odometer and gyro said about a stretch of time.

    Attributes
    ----------
    distance : float
        Rolled forward, metres, as the odometer counts them.
    turn : float
        Integrated yaw rate, radians, as the gyro reads it: bias included.
    distance_sigma, turn_sigma : float
        Standard deviations beyond the model's own, metres and radians: for a stretch that was not measured.
    """

    distance: float
    turn: float
    distance_sigma: float = 0.0
    turn_sigma: float = 0.0


class UnicycleStep(NamedTuple):
    """One prediction, ready for the kernel: the same numbers for every particle."""

    distance: float
    turn: float
    duration: float
    distance_sigma: float
    turn_sigma: float
    bias_gain: float
    scale_gain: float


class Unicycle:
    """Noisy unicycle motion along the chord of an arc, with marginalised gyro bias and odometry scale.

    With d the distance and t the turn of the control over a time T, a particle's means b and s of bias and scale, their
    shared variances P and S, and n1, n2 standard normals::

        P += gyro_bias_walk² T,  S += odometry_scale_walk² T
        Q = yaw_rate_noise² T + turn_noise² |t|,  R = speed_noise² T + slip_noise² |d|
        d' = s d + sqrt(R + d² S) n1,  s += d S / sqrt(R + d² S) n1,  S = S R / (R + d² S)
        t' = t - b T + sqrt(Q + T² P) n2,  b -= T P / sqrt(Q + T² P) n2,  P = P Q / (Q + T² P)
        north   += d' cos(heading + t'/2)
        east    += d' sin(heading + t'/2)
        heading += t'

    The turn and the distance are drawn with the uncertainty of bias and scale in them, and the draw is then taken as a
    measurement of both: a Kalman filter of one dimension each, given the particle's path. The noises are densities, so
    the belief after a second is the same whatever the rate of the ticks. The chord of an arc is shorter than the arc by
    the factor sin(t'/2) / (t'/2), which is left out: 4e-6 at 0.01 rad.

    Parameters
    ----------
    speed_noise : float
        Of the distance, m/√s.
    yaw_rate_noise : float
        Of the turn, rad/√s.
    gyro_bias_walk : float
        Of the gyro's bias, (rad/s)/√s.
    odometry_scale_walk : float
        Of the odometer's scale (true over counted), 1/√s.
    slip_noise : float
        Of the distance for each square root of a metre rolled, m/√m.
    turn_noise : float
        Of the turn for each square root of a radian turned, rad/√rad.
    gyro_bias_sigma, odometry_scale_sigma : float
        What bias (rad/s) and scale may be off by at the start, beyond the spread of the particles' own values.

    Raises
    ------
    ValueError
        A density is negative or not finite.
    """

    names = ("north", "east", "heading", GYRO_BIAS, ODOMETRY_SCALE)
    noises = 2
    walks: tuple[RandomWalk, ...] = ()

    def __init__(
        self,
        speed_noise: float,
        yaw_rate_noise: float,
        gyro_bias_walk: float,
        odometry_scale_walk: float,
        slip_noise: float = 0.0,
        turn_noise: float = 0.0,
        gyro_bias_sigma: float = 0.0,
        odometry_scale_sigma: float = 0.0,
    ) -> None:
        densities = {
            "speed_noise": speed_noise,
            "yaw_rate_noise": yaw_rate_noise,
            "gyro_bias_walk": gyro_bias_walk,
            "odometry_scale_walk": odometry_scale_walk,
            "slip_noise": slip_noise,
            "turn_noise": turn_noise,
            "gyro_bias_sigma": gyro_bias_sigma,
            "odometry_scale_sigma": odometry_scale_sigma,
        }
        for name, density in densities.items():
            if not 0.0 <= density < math.inf:
                raise ValueError(f"unicycle: {name} must be finite and not negative, got {density}")
        self.speed_noise = speed_noise
        self.yaw_rate_noise = yaw_rate_noise
        self.slip_noise = slip_noise
        self.turn_noise = turn_noise
        self.gyro_bias_walk = gyro_bias_walk
        self.odometry_scale_walk = odometry_scale_walk
        self.gyro_bias_sigma = gyro_bias_sigma
        self.odometry_scale_sigma = odometry_scale_sigma
        self._bias_variance = gyro_bias_sigma**2
        self._scale_variance = odometry_scale_sigma**2

    def start(self) -> None:
        """Forget what was learned of bias and scale."""
        self._bias_variance = self.gyro_bias_sigma**2
        self._scale_variance = self.odometry_scale_sigma**2

    @property
    def conditional_variances(self) -> dict[str, float]:
        """Variances of bias and scale given a particle's path; the spread of the particles' means comes on top."""
        return {GYRO_BIAS: self._bias_variance, ODOMETRY_SCALE: self._scale_variance}

    def reopen(self, variances: Mapping[str, float]) -> None:
        """Add to what the paths leave open of bias and scale; see :class:`filters.motion.model.Reopening`."""
        self._bias_variance += variances[GYRO_BIAS]
        self._scale_variance += variances[ODOMETRY_SCALE]

    def noise_variances(self, control: UnicycleControl, duration: float) -> tuple[float, float]:
        """Return the variances of the distance (m²) and of the turn (rad²) that a control leaves open: R and Q."""
        distance, turn, distance_sigma, turn_sigma = control
        speed, slip, yaw, turned = self.speed_noise, self.slip_noise, self.yaw_rate_noise, self.turn_noise
        return (
            speed * speed * duration + slip * slip * abs(distance) + distance_sigma * distance_sigma,
            yaw * yaw * duration + turned * turned * abs(turn) + turn_sigma * turn_sigma,
        )

    def begin(self, control: UnicycleControl, duration: float) -> UnicycleStep:
        """Prepare one prediction and update the shared variances; see :class:`filters.motion.Motion`."""
        distance, turn, distance_sigma, turn_sigma = control
        total = distance + turn + distance_sigma + turn_sigma  # a third of the time of looking at each
        if not math.isfinite(total) and not all(map(math.isfinite, control)):
            raise ValueError(f"unicycle: every number of the control must be finite, got {control}")
        bias_walk, scale_walk = self.gyro_bias_walk, self.odometry_scale_walk
        distance_variance, turn_variance = self.noise_variances(control, duration)
        bias_variance = self._bias_variance + bias_walk * bias_walk * duration
        scale_variance = self._scale_variance + scale_walk * scale_walk * duration
        turn_total = turn_variance + duration * duration * bias_variance
        distance_total = distance_variance + distance * distance * scale_variance
        turn_sigma, distance_sigma = math.sqrt(turn_total), math.sqrt(distance_total)
        if turn_total > 0.0:
            self._bias_variance = bias_variance * turn_variance / turn_total
        if distance_total > 0.0:
            self._scale_variance = scale_variance * distance_variance / distance_total
        bias_gain = -duration * bias_variance / turn_sigma if turn_total > 0.0 else 0.0
        scale_gain = distance * scale_variance / distance_sigma if distance_total > 0.0 else 0.0
        return tuple.__new__(  # what the constructor does, without its call in Python
            UnicycleStep, (distance, turn, duration, distance_sigma, turn_sigma, bias_gain, scale_gain)
        )

    def move(
        self, particles: ParticleSet, first: int, last: int, noise: Float32Array, step: UnicycleStep
    ) -> None:
        """Move a block of particles in place; see :class:`filters.motion.Motion`."""
        roll.direct(particles.columns, noise, first, last, *step)

    def move_all(
        self,
        particles: ParticleSet,
        centre: ParticleSet,
        pieces: NDArray[np.int64],
        noise: Float32Array,
        draw: tuple[int, int],
        step: UnicycleStep,
    ) -> None:
        """Draw for some blocks and move them; see :class:`filters.motion.model.Drawing`."""
        roll_all.direct(particles.columns, centre.columns, _STILL, pieces, noise, *draw, *step)


@kernel(
    "void(float32[:, ::1], float32[:, ::1], int64, int64, float32, float32, float32, float32, float32, float32,"
    "float32)"
)
def roll(
    columns: Float32Array,
    noise: Float32Array,
    first: int,
    last: int,
    distance: float,
    turn: float,
    duration: float,
    distance_sigma: float,
    turn_sigma: float,
    bias_gain: float,
    scale_gain: float,
) -> None:
    """Move every particle of a block along its chord, and learn its bias and scale from the draw."""
    north = columns[0, first:last]
    east = columns[1, first:last]
    heading = columns[2, first:last]
    bias = columns[3, first:last]
    scale = columns[4, first:last]
    distance_noise = noise[0]
    turn_noise = noise[1]
    for i in range(last - first):
        d = float32(scale[i] * distance + distance_sigma * distance_noise[i])
        t = float32(turn - bias[i] * duration + turn_sigma * turn_noise[i])
        h = heading[i]
        s, c = sincos(float32(h + float32(0.5) * t))
        north[i] += d * c
        east[i] += d * s
        heading[i] = wrapped(float32(h + t))
        bias[i] += bias_gain * turn_noise[i]
        scale[i] += scale_gain * distance_noise[i]


@kernel(
    "void(float32[:, ::1], float32[:, ::1], float32[:, ::1], int64[:, ::1], float32[:, ::1], uint32, uint32, float32,"
    "float32, float32, float32, float32, float32, float32)"
)
def roll_all(
    columns: Float32Array,
    centre: Float32Array,
    still: Float32Array,
    pieces: NDArray[np.int64],
    noise: Float32Array,
    number: int,
    stream_key: int,
    distance: float,
    turn: float,
    duration: float,
    distance_sigma: float,
    turn_sigma: float,
    bias_gain: float,
    scale_gain: float,
) -> None:
    """Draw for one piece after the other and :func:`roll` it; the centre goes with particle 0, without noise."""
    for k in range(pieces.shape[0]):
        first, last = pieces[k, 0], pieces[k, 1]
        normal_pairs(first, last, number, stream_key, noise, 0)
        roll(
            columns,
            noise,
            first,
            last,
            distance,
            turn,
            duration,
            distance_sigma,
            turn_sigma,
            bias_gain,
            scale_gain,
        )
        if first == 0:
            roll(
                centre,
                still,
                0,
                1,
                distance,
                turn,
                duration,
                distance_sigma,
                turn_sigma,
                bias_gain,
                scale_gain,
            )
