"""Inertial messages: HIGHRES_IMU in SI units, RAW_IMU and SCALED_IMU/2/3 in thousandths, ATTITUDE."""

from __future__ import annotations

import math
from typing import Any

from drivers.mavlink.moment import Moment, Timed
from drivers.sample import Attitude, Inertial, Pressure, Rotation, Vector

MILLI_G = 9.80665e-3  # m/s²
MILLI = 1e-3  # rad/s
GAUSS = 1e-4  # tesla
HECTOPASCAL = 100.0
KELVIN = 273.15
ARDUPILOT = 3  # MAV_AUTOPILOT_ARDUPILOTMEGA

# What a MEMS unit can say at most: 2,000 degrees per second, 32 g; and ten times the strongest disturbance of
# the Earth's field that a vehicle bears. ArduPilot's HIGHRES_IMU magnetometer is a million times too large.
LARGEST_RATE = 40.0
LARGEST_FORCE = 330.0
LARGEST_FIELD = 2e-3
SATURATED = 32_767

ACCELERATION_BITS, GYRO_BITS, MAGNETIC_BITS, PRESSURE_BIT, YAW_RATE_BIT, TEMPERATURE_BIT = (
    7,
    56,
    448,
    512,
    32,
    4096,
)


def _vector(x: float, y: float, z: float, largest: float) -> Vector | None:
    """Return the vector, or ``None`` when it is not finite or longer than it can be."""
    norm = math.sqrt(x * x + y * y + z * z)
    return (x, y, z) if norm <= largest else None  # a NaN compares false


def _inertial(rate: Vector | None, force: Vector | None, field: Vector | None) -> list[Inertial]:
    if rate is None and force is None and field is None:
        return []
    return [Inertial(rate, force, field)]


def highres_imu(fields: Any, at: Moment) -> list[Timed]:
    """HIGHRES_IMU 105: only what ``fields_updated`` names; a lone yaw rate becomes a :class:`Rotation`.

    Units beyond the first (``id``) see the same motion: used beside it they would count twice.
    """
    if fields.id != 0:
        at.pass_over("id")
        return []
    updated: int = fields.fields_updated
    rate = force = field = None
    if updated & GYRO_BITS == GYRO_BITS:
        rate = _vector(fields.xgyro, fields.ygyro, fields.zgyro, LARGEST_RATE)
        if rate is None:
            at.refuse("gyro")
    if updated & ACCELERATION_BITS == ACCELERATION_BITS:
        force = _vector(fields.xacc, fields.yacc, fields.zacc, LARGEST_FORCE)
        if force is None:
            at.refuse("acc")
    if updated & MAGNETIC_BITS == MAGNETIC_BITS:
        field = _vector(fields.xmag * GAUSS, fields.ymag * GAUSS, fields.zmag * GAUSS, LARGEST_FIELD)
        if field is None:
            at.refuse("mag")
    time = at.microseconds(fields.time_usec)
    readings: list[Timed] = [(time, reading) for reading in _inertial(rate, force, field)]
    if updated & GYRO_BITS == YAW_RATE_BIT:
        readings.append((time, Rotation(fields.zgyro)))
    if updated & PRESSURE_BIT:
        temperature = fields.temperature + KELVIN if updated & TEMPERATURE_BIT else None
        readings.append((time, Pressure(fields.abs_pressure * HECTOPASCAL, temperature=temperature)))
    return readings


def raw_imu(fields: Any, at: Moment) -> list[Timed]:
    """RAW_IMU 27: ArduPilot scales it like SCALED_IMU; from others it is counts of an unknown scale.

    Until a heartbeat has said which autopilot it is, ArduPilot is taken for granted: nobody else is known to send it.
    """
    if at.autopilot not in (ARDUPILOT, None):
        at.pass_over("autopilot")
        return []
    if fields.id != 0:
        at.pass_over("id")
        return []
    time = at.microseconds(fields.time_usec)
    return [(time, reading) for reading in _thousandths(fields, at)]


def scaled_imu(fields: Any, at: Moment) -> list[Timed]:
    """SCALED_IMU 26, SCALED_IMU2 116, SCALED_IMU3 129: mG, mrad/s, mgauss."""
    time = at.boot_ms(fields.time_boot_ms)
    return [(time, reading) for reading in _thousandths(fields, at)]


def _thousandths(fields: Any, at: Moment) -> list[Inertial]:
    """Read the int16 triples; all zero is absent, but for a gyro at rest beside an accelerometer."""
    force = _triple((fields.xacc, fields.yacc, fields.zacc), MILLI_G, "acc", at)
    rate = _triple((fields.xgyro, fields.ygyro, fields.zgyro), MILLI, "gyro", at)
    field = _triple((fields.xmag, fields.ymag, fields.zmag), MILLI * GAUSS, "mag", at)
    if rate is None and force is not None and not (fields.xgyro or fields.ygyro or fields.zgyro):
        rate = (0.0, 0.0, 0.0)
    return _inertial(rate, force, field)


def _triple(counts: tuple[int, int, int], unit: float, field: str, at: Moment) -> Vector | None:
    if not any(counts):
        return None
    if max(map(abs, counts)) >= SATURATED:
        at.refuse(field)
        return None
    return counts[0] * unit, counts[1] * unit, counts[2] * unit


def attitude(fields: Any, at: Moment) -> list[Timed]:
    """ATTITUDE 30: the autopilot's filter, so correlated with its GNSS; the yaw may come as 0 to 2 pi."""
    time = at.boot_ms(fields.time_boot_ms)
    rates = _vector(fields.rollspeed, fields.pitchspeed, fields.yawspeed, LARGEST_RATE)
    if rates is None:
        at.refuse("rates")
    return [(time, Attitude(fields.roll, fields.pitch, fields.yaw, rates))]
