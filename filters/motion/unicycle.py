"""Unicycle: a ground vehicle that rolls forward and turns; its odometer's and gyro's errors are states."""

from __future__ import annotations

import math
from typing import NamedTuple

from numpy import float32

from filters.kernels.compile import Float32Array, kernel
from filters.kernels.elementary import sincos, wrapped
from filters.motion.slow import RandomWalk
from filters.particle_set import ParticleSet

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
    """

    distance: float
    turn: float


class Unicycle:
    """Noisy unicycle motion along the chord of an arc.

    With d the distance and t the turn of the control over a time T, and n1, n2 standard normals::

        d' = odometry_scale · d + sqrt(speed_noise² T + slip_noise² |d|) n1
        t' = t - gyro_bias · T  + sqrt(yaw_rate_noise² T + turn_noise² |t|) n2
        north   += d' cos(heading + t'/2)
        east    += d' sin(heading + t'/2)
        heading += t'

    The noises are densities, so the belief after a second is the same whatever the rate of the ticks. The
    chord of an arc is shorter than the arc by the factor sin(t'/2) / (t'/2), which is left out: 4e-6 at 0.01
    rad.

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

    Raises
    ------
    ValueError
        A density is negative or not finite.
    """

    names = ("north", "east", "heading", GYRO_BIAS, ODOMETRY_SCALE)
    noises = 2

    def __init__(
        self,
        speed_noise: float,
        yaw_rate_noise: float,
        gyro_bias_walk: float,
        odometry_scale_walk: float,
        slip_noise: float = 0.0,
        turn_noise: float = 0.0,
    ) -> None:
        densities = {
            "speed_noise": speed_noise,
            "yaw_rate_noise": yaw_rate_noise,
            "gyro_bias_walk": gyro_bias_walk,
            "odometry_scale_walk": odometry_scale_walk,
            "slip_noise": slip_noise,
            "turn_noise": turn_noise,
        }
        for name, density in densities.items():
            if not 0.0 <= density < math.inf:
                raise ValueError(f"unicycle: {name} must be finite and not negative, got {density}")
        self.speed_noise = speed_noise
        self.yaw_rate_noise = yaw_rate_noise
        self.slip_noise = slip_noise
        self.turn_noise = turn_noise
        self.walks = (RandomWalk(GYRO_BIAS, gyro_bias_walk), RandomWalk(ODOMETRY_SCALE, odometry_scale_walk))

    def move(
        self,
        particles: ParticleSet,
        first: int,
        last: int,
        noise: Float32Array,
        control: UnicycleControl,
        duration: float,
    ) -> None:
        """Move a block of particles in place; see :class:`filters.motion.Motion`."""
        distance, turn = control
        if not (math.isfinite(distance) and math.isfinite(turn)):
            raise ValueError(f"unicycle: distance and turn must be finite, got {distance} m and {turn} rad")
        distance_variance = self.speed_noise**2 * duration + self.slip_noise**2 * abs(distance)
        turn_variance = self.yaw_rate_noise**2 * duration + self.turn_noise**2 * abs(turn)
        roll(
            particles.columns,
            noise,
            first,
            last,
            distance,
            turn,
            duration,
            math.sqrt(distance_variance),
            math.sqrt(turn_variance),
        )


@kernel("void(float32[:, ::1], float32[:, ::1], int64, int64, float32, float32, float32, float32, float32)")
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
) -> None:
    """Move every particle of a block along its chord."""
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
