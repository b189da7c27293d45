"""What the vehicle is told: POSITION_TARGET_LOCAL_NED, SERVO_OUTPUT_RAW; and who is there: HEARTBEAT."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from drivers.mavlink.moment import Moment, Timed
from drivers.mavlink.settings import ServoCalibration
from drivers.sample import ActuatorCommand, MotionCommand, Presence, Vector

IGNORE_HORIZONTAL, IGNORE_DOWN, IGNORE_YAW_RATE = 8 | 16, 32, 2048
NED_FRAMES = frozenset({1, 7})  # LOCAL_NED, LOCAL_OFFSET_NED
BODY_FRAMES = frozenset({8, 9, 12})  # BODY_NED, BODY_OFFSET_NED (both turn with the heading), BODY_FRD

OUTPUTS_PER_PORT = 16
NO_PULSE = (0, 0xFFFF)
SAFETY_ARMED = 128


def position_target(fields: Any, at: Moment) -> list[Timed]:
    """POSITION_TARGET_LOCAL_NED 85: the velocity and yaw rate that ``type_mask`` does not say to ignore.

    A ground vehicle ignores the vertical axis alone: then the commanded vertical velocity is none, 0.
    """
    frame: int = fields.coordinate_frame
    if frame not in NED_FRAMES and frame not in BODY_FRAMES:
        at.pass_over("coordinate_frame")
        return []
    velocity: Vector | None = None
    if not fields.type_mask & IGNORE_HORIZONTAL:
        down = 0.0 if fields.type_mask & IGNORE_DOWN else fields.vz
        velocity = (fields.vx, fields.vy, down)
        if not all(map(math.isfinite, velocity)):  # PX4 marks what it does not command by NaN
            velocity = None
    yaw_rate: float | None = None
    if not fields.type_mask & IGNORE_YAW_RATE and math.isfinite(fields.yaw_rate):
        yaw_rate = fields.yaw_rate
    if velocity is None and yaw_rate is None:
        return []
    return [(at.boot_ms(fields.time_boot_ms), MotionCommand(velocity, yaw_rate, frame in BODY_FRAMES))]


def deflection(pulse: int, servo: ServoCalibration) -> float | None:
    """Return a pulse width in microseconds as -1 to 1 about the trim; 0 and UINT16_MAX are no pulse."""
    if pulse in NO_PULSE:
        return None
    side = servo.maximum - servo.trim if pulse >= servo.trim else servo.trim - servo.minimum
    value = max(-1.0, min(1.0, (pulse - servo.trim) / side)) if side else 0.0
    return -value if servo.reversed else value


class Servos:
    """SERVO_OUTPUT_RAW 36 through a calibration; ``port`` 0 has the channels 1 to 16, 1 those from 17."""

    def __init__(self, servos: Sequence[ServoCalibration]) -> None:
        self._servos = tuple(servos)

    def __call__(self, fields: Any, at: Moment) -> list[Timed]:
        """Return the commands by channel (index 0 is SERVO1); ``None``: not calibrated, or no pulse."""
        first = fields.port * OUTPUTS_PER_PORT
        mine = [servo for servo in self._servos if first < servo.channel <= first + OUTPUTS_PER_PORT]
        if not mine:
            return []
        channels: list[float | None] = [None] * max(servo.channel for servo in mine)
        for servo in mine:
            pulse: int = getattr(fields, f"servo{servo.channel - first}_raw")
            channels[servo.channel - 1] = deflection(pulse, servo)
        return [(at.boot_us_32(fields.time_usec), ActuatorCommand(tuple(channels)))]


def heartbeat(fields: Any, at: Moment) -> list[Timed]:
    """HEARTBEAT 0 of a vehicle (others are sorted out before)."""
    armed = bool(fields.base_mode & SAFETY_ARMED)
    return [(at.received, Presence(fields.type, fields.autopilot, armed, fields.system_status))]
