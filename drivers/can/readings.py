"""DroneCAN messages as readings: one small generator for each message type that beliefd understands.

Each yields what the message says, in SI units, or :class:`Refused` with a field that is broken, or
:class:`PassedOver` with the field by which a sound message says that it has nothing for us.
Whether the numbers can be true is judged afterwards, for all drivers alike, by :mod:`drivers.plausibility`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from drivers.can.dsdl import DataType, Message
from drivers.can.settings import CanSettings
from drivers.sample import (
    ActuatorCommand,
    AnyReading,
    Clearance,
    GeodeticPosition,
    Inertial,
    MotorSpeed,
    Pressure,
    Velocity,
)


class Refused(NamedTuple):
    """A field of a message that is broken."""

    field: str


class PassedOver(NamedTuple):
    """A field by which a message that is sound says nothing usable: no fix, too far, another unit."""

    field: str


Readings = Iterator[AnyReading | Refused | PassedOver]

_TWO_DIMENSIONS = 2  # gnss.Fix2 STATUS_2D_FIX
_THREE_DIMENSIONS = 3  # STATUS_3D_FIX
_VALID_RANGE = 1  # range_sensor.Measurement READING_TYPE_VALID_RANGE
_UNITLESS = 0  # actuator.Command COMMAND_TYPE_UNITLESS
_PULSE_WIDTH = 4  # COMMAND_TYPE_PWM
_PULSE_CENTRE = 1500.0  # µs
_PULSE_HALF_RANGE = 500.0  # µs
_FULL_FORWARD = 8191.0
_FULL_REVERSE = 8192.0
_ORIENTATION_STEP = math.pi / 12.0  # CoarseOrientation counts fifteen degrees
_UP, _DOWN, _CUSTOM = 24, 25, 100  # MAV_SENSOR_ORIENTATION PITCH_90, PITCH_270, CUSTOM
_TESLA_PER_GAUSS = 1e-4

# Where the six variances (north, east, down, then their velocities) stand in gnss.Fix2.covariance, by its
# length: a scalar, a diagonal, an upper triangle, a full matrix.
_DIAGONAL: dict[int, Sequence[int]] = {
    1: (0, 0, 0, 0, 0, 0),
    6: (0, 1, 2, 3, 4, 5),
    21: (0, 6, 11, 15, 18, 20),
    36: (0, 7, 14, 21, 28, 35),
}


def _deviation(variances: Sequence[float]) -> float | None:
    """Root of the mean variance per axis; zero or NaN is how a sender says that it does not know."""
    mean = sum(variances) / len(variances)
    if math.isnan(mean) or mean == 0.0:
        return None
    return math.sqrt(mean) if mean > 0.0 else math.nan


def _fix(message: Message, _settings: CanSettings) -> Readings:
    status = message["status"]
    if status < _TWO_DIMENSIONS:
        yield PassedOver("status")
        return
    solid = status >= _THREE_DIMENSIONS
    covariance = message["covariance"]
    horizontal = vertical = speed = None
    if len(covariance) in _DIAGONAL:
        variances = [covariance[i] for i in _DIAGONAL[len(covariance)]]
        horizontal, vertical, speed = (_deviation(variances[part]) for part in _AXES)
    elif covariance:
        yield Refused("covariance")
    yield GeodeticPosition(
        latitude=math.radians(message["latitude_deg_1e8"] * 1e-8),
        longitude=math.radians(message["longitude_deg_1e8"] * 1e-8),
        altitude=message["height_msl_mm"] * 1e-3 if solid else None,
        sigma_horizontal=horizontal,
        sigma_vertical=vertical if solid else None,
        satellites=message["sats_used"],
    )
    north, east, down = message["ned_velocity"]
    yield Velocity(north=north, east=east, down=down if solid else None, sigma=speed)


_AXES = (slice(0, 2), slice(2, 3), slice(3, 6))


def _inertial(message: Message, _settings: CanSettings) -> Readings:
    gyroscope, accelerometer = message["rate_gyro_latest"], message["accelerometer_latest"]
    # A NaN in one sensor is no reason to lose the other.
    if not all(map(math.isfinite, gyroscope)):
        yield Refused("angular_velocity")
        gyroscope = None
    if not all(map(math.isfinite, accelerometer)):
        yield Refused("specific_force")
        accelerometer = None
    if gyroscope or accelerometer:
        yield Inertial(
            angular_velocity=tuple(gyroscope) if gyroscope else None,
            specific_force=tuple(accelerometer) if accelerometer else None,
        )


def _magnetic(message: Message, _settings: CanSettings) -> Readings:
    x, y, z = (value * _TESLA_PER_GAUSS for value in message["magnetic_field_ga"])
    yield Inertial(magnetic_field=(x, y, z))


def _pressure(message: Message, _settings: CanSettings) -> Readings:
    yield Pressure(absolute=message["static_pressure"])


def _orientation(message: Message, settings: CanSettings) -> int:
    """Return the MAV_SENSOR_ORIENTATION of a beam; its roll about itself does not matter."""
    beam = message["beam_orientation_in_body_frame"]
    if not beam["orientation_defined"]:
        return settings.range_orientation
    _, pitch, yaw = (steps * _ORIENTATION_STEP for steps in beam["fixed_axis_roll_pitch_yaw"])
    sine = math.sin(pitch)
    if abs(sine) > 0.99:
        return _UP if sine > 0.0 else _DOWN
    eighths = math.atan2(math.cos(pitch) * math.sin(yaw), math.cos(pitch) * math.cos(yaw)) / (math.pi / 4.0)
    if abs(sine) > 0.01 or abs(eighths - round(eighths)) > 0.01:
        return _CUSTOM
    return round(eighths) % 8


def _clearance(message: Message, settings: CanSettings) -> Readings:
    if message["reading_type"] != _VALID_RANGE:
        yield PassedOver("reading_type")
        return
    yield Clearance(distance=message["range"], orientation=_orientation(message, settings))


def _motor(message: Message, _settings: CanSettings) -> Readings:
    yield MotorSpeed(index=message["esc_index"], angular_speed=message["rpm"] * (2.0 * math.pi / 60.0))


def _throttles(message: Message, _settings: CanSettings) -> Readings:
    commands = message["cmd"]
    if not commands:
        yield PassedOver("cmd")
        return
    yield ActuatorCommand(tuple(c / (_FULL_FORWARD if c > 0 else _FULL_REVERSE) for c in commands))


def _actuator(command: Message) -> float | Refused | PassedOver | None:
    """Return one command in -1…1, ``None`` for a servo without pulses."""
    value = command["command_value"]
    if command["command_type"] == _PULSE_WIDTH:
        if value == 0.0:
            return None
        value = (value - _PULSE_CENTRE) / _PULSE_HALF_RANGE
    elif command["command_type"] != _UNITLESS:
        return PassedOver("command_type")
    return value if -1.0 <= value <= 1.0 else Refused("command_value")


def _actuators(message: Message, _settings: CanSettings) -> Readings:
    """One message commands up to 15 of 256 actuators; a channel that it does not name is ``None``."""
    channels: dict[int, float | None] = {}
    for command in message["commands"]:
        value = _actuator(command)
        if isinstance(value, Refused | PassedOver):
            yield value
        else:
            channels[command["actuator_id"]] = value
    if channels:
        yield ActuatorCommand(tuple(channels.get(i) for i in range(max(channels) + 1)))


_READERS: dict[str, Callable[[Message, CanSettings], Readings]] = {
    "uavcan.equipment.gnss.Fix2": _fix,
    "uavcan.equipment.ahrs.RawIMU": _inertial,
    "uavcan.equipment.ahrs.MagneticFieldStrength2": _magnetic,
    "uavcan.equipment.air_data.StaticPressure": _pressure,
    "uavcan.equipment.range_sensor.Measurement": _clearance,
    "uavcan.equipment.esc.Status": _motor,
    "uavcan.equipment.esc.RawCommand": _throttles,
    "uavcan.equipment.actuator.ArrayCommand": _actuators,
}

DATA_TYPES: dict[int, DataType] = {t.identifier: t for t in map(DataType, _READERS)}
"""The message types that are understood, by data type id."""

_BY_TYPE = {t.identifier: read for t, read in zip(DATA_TYPES.values(), _READERS.values(), strict=True)}


def readings_of(data_type: DataType, message: Message, settings: CanSettings) -> Readings:
    """Yield what a message of one of :data:`DATA_TYPES` says."""
    return _BY_TYPE[data_type.identifier](message, settings)
