"""How a rover answers its commands: skid and Ackermann steering, with the limits that real ones have.

Speed is that of the body's origin (the middle between the driven wheels) along the body's forward axis; yaw
rate is about down, positive clockwise seen from above. Wheels do not slip here: slip is an error of the
encoder that sees it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True, slots=True)
class Command:
    """What the driver asks for: speed in m/s and yaw rate in rad/s."""

    speed: float = 0.0
    yaw_rate: float = 0.0


@dataclass(frozen=True, slots=True)
class Motion:
    """How the body moves: speed in m/s, yaw rate in rad/s, steering angle of the front wheels in radians."""

    speed: float = 0.0
    yaw_rate: float = 0.0
    steering: float = 0.0


class Rover(Protocol):
    """A kind of rover: how it moves, and what its left and right wheels do meanwhile."""

    def respond(self, motion: Motion, command: Command, duration: float) -> Motion:
        """Return the motion after ``duration`` seconds of a command."""
        ...

    def wheel_speeds(self, motion: Motion) -> tuple[float, float]:
        """Return the rolling speeds of the left and the right wheels, m/s."""
        ...


def _toward(value: float, target: float, largest_change: float) -> float:
    return value + min(largest_change, max(-largest_change, target - value))


@dataclass(frozen=True, slots=True)
class SkidRover:
    """Left and right wheels driven apart; it turns on the spot.

    Attributes
    ----------
    track : float
        Distance between left and right wheels, metres.
    turning_slip : float
        The wheels roll as if the track were wider by this factor, because they scrub sideways in a turn
        (Mandow et al., 2007: the instantaneous centres of rotation lie outside the tracks).
    acceleration, yaw_acceleration : float
        Largest change of speed (m/s²) and of yaw rate (rad/s²).
    """

    track: float = 0.5
    turning_slip: float = 1.3
    acceleration: float = 0.8
    yaw_acceleration: float = 1.5

    def respond(self, motion: Motion, command: Command, duration: float) -> Motion:
        """Return the motion after ``duration`` seconds: both rates follow the command within their limits."""
        return Motion(
            speed=_toward(motion.speed, command.speed, self.acceleration * duration),
            yaw_rate=_toward(motion.yaw_rate, command.yaw_rate, self.yaw_acceleration * duration),
        )

    def wheel_speeds(self, motion: Motion) -> tuple[float, float]:
        """Return the rolling speeds of the left and the right wheels, m/s."""
        half = 0.5 * self.track * self.turning_slip * motion.yaw_rate
        return motion.speed + half, motion.speed - half


@dataclass(frozen=True, slots=True)
class AckermannRover:
    """Front wheels steer, rear wheels drive: yaw rate = speed · tan(steering) / wheelbase.

    Attributes
    ----------
    wheelbase, track : float
        Between the axles; between the rear wheels; metres.
    steering_limit, steering_rate : float
        Largest angle (radians) and its largest change (rad/s).
    acceleration : float
        Largest change of speed, m/s².
    """

    wheelbase: float = 0.8
    track: float = 0.6
    steering_limit: float = 0.6
    steering_rate: float = 1.2
    acceleration: float = 0.8

    def respond(self, motion: Motion, command: Command, duration: float) -> Motion:
        """Return the motion after ``duration`` seconds: speed and steering follow within their limits."""
        speed = _toward(motion.speed, command.speed, self.acceleration * duration)
        steering = motion.steering
        if abs(command.speed) > 1e-3:
            asked = math.atan(command.yaw_rate * self.wheelbase / command.speed)
            bounded = min(self.steering_limit, max(-self.steering_limit, asked))
            steering = _toward(steering, bounded, self.steering_rate * duration)
        return Motion(speed, speed * math.tan(steering) / self.wheelbase, steering)

    def wheel_speeds(self, motion: Motion) -> tuple[float, float]:
        """Return the rolling speeds of the left and the right rear wheels, m/s."""
        half = 0.5 * self.track * motion.yaw_rate
        return motion.speed + half, motion.speed - half
