"""What the autopilot knows, and how it says so: every message, with its scaling and sentinels.

The numbers of the wire are those of the MAVLink definitions (dialect ``all``); each function returns ``None``
when there is nothing to say yet, or nothing new.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from pymavlink.dialects.v20 import all as mavlink

from sim_vehicle.attitude import AttitudeFilter
from sim_vehicle.clock import BoardClock
from sim_vehicle.geodesy import Origin
from sim_vehicle.sensors import (
    BeaconReading,
    CompassReading,
    GnssReading,
    InertialReading,
    PressureReading,
    WheelReading,
)
from sim_vehicle.sensors.barometer import standard_altitude
from sim_vehicle.world import Truth

GAUSS_PER_TESLA = 1e4
KELVIN_AT_ZERO_CELSIUS = 273.15
BEACON_ACCURACY_MM = 50
UNUSED_WHEELS = (0.0,) * 14

_ACCELEROMETER_FIELDS = 0b111
_GYRO_FIELDS = 0b111 << 3
_MAGNETOMETER_FIELDS = 0b111 << 6
_PRESSURE_FIELDS = (1 << 9) | (1 << 11) | (1 << 12)
_VELOCITY_AND_YAW_RATE_ONLY = 0b0101_1100_0111
"""POSITION_TARGET_TYPEMASK: position, acceleration and yaw are to be ignored."""


@dataclass(slots=True)
class Knowledge:
    """The latest of every sensor, and what was made of it.

    Attributes
    ----------
    clock, origin : BoardClock, Origin
        Of the autopilot and of the site.
    unix : float
        Unix seconds when the drive began; told only once a receiver has had a fix.
    range_sigma : float or None
        Standard deviation that the ranging radio claims, metres.
    declination : float
        Radians, as the autopilot's table says.
    """

    clock: BoardClock
    origin: Origin
    unix: float
    track: float
    range_sigma: float | None = None
    declination: float = 0.0
    attitude: AttitudeFilter = field(default_factory=AttitudeFilter)
    wheels: WheelReading | None = None
    speed: float = 0.0
    inertial: InertialReading | None = None
    compass: CompassReading | None = None
    pressure: PressureReading | None = None
    gnss: GnssReading | None = None
    had_fix: bool = False
    truth: Truth | None = None


Message = mavlink.MAVLink_message


def heartbeat() -> Message:
    """Return HEARTBEAT: an armed ArduPilot rover in AUTO."""
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_GROUND_ROVER,
        mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
        mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_SAFETY_ARMED,
        10,
        mavlink.MAV_STATE_ACTIVE,
        3,
    )


def highres_imu(known: Knowledge) -> Message | None:
    """Return HIGHRES_IMU of the last inertial reading; ``fields_updated`` says what else there is."""
    inertial = known.inertial
    if inertial is None:
        return None
    field_gauss, updated = (0.0, 0.0, 0.0), _ACCELEROMETER_FIELDS | _GYRO_FIELDS
    if known.compass is not None:
        forward, right, down = (GAUSS_PER_TESLA * axis for axis in known.compass.field)
        field_gauss, updated = (forward, right, down), updated | _MAGNETOMETER_FIELDS
    pressure_hpa = altitude = temperature = 0.0
    if known.pressure is not None:
        pressure_hpa = 0.01 * known.pressure.pressure
        altitude = standard_altitude(known.pressure.pressure)
        temperature = known.pressure.temperature - KELVIN_AT_ZERO_CELSIUS
        updated |= _PRESSURE_FIELDS
    return mavlink.MAVLink_highres_imu_message(
        known.clock.microseconds(inertial.time),
        *inertial.specific_force,
        *inertial.angular_velocity,
        *field_gauss,
        pressure_hpa,
        0.0,
        altitude,
        temperature,
        updated,
    )


def attitude(known: Knowledge) -> Message | None:
    """Return ATTITUDE of the autopilot's own filter, yaw in (-pi, pi]."""
    inertial = known.inertial
    if inertial is None:
        return None
    return mavlink.MAVLink_attitude_message(
        known.clock.milliseconds(inertial.time),
        0.0,
        0.0,
        math.remainder(known.attitude.yaw, math.tau),
        *inertial.angular_velocity,
    )


def wheel_distance(known: Knowledge) -> Message | None:
    """Return WHEEL_DISTANCE: cumulative metres, left then right."""
    wheels = known.wheels
    if wheels is None:
        return None
    return mavlink.MAVLink_wheel_distance_message(
        known.clock.microseconds(wheels.time), 2, [wheels.left, wheels.right, *UNUSED_WHEELS]
    )


def ranging_beacon(known: Knowledge, reading: BeaconReading) -> Message:
    """Return RANGING_BEACON (513) for one range: millimetres, 1e-7 degrees, altitude above the sea."""
    site = reading.beacon
    latitude, longitude, altitude = known.origin.geodetic(site.north, site.east, site.down)
    unknown = 0xFFFF_FFFF
    return mavlink.MAVLink_ranging_beacon_message(
        known.clock.microseconds(reading.time),
        0,
        0,
        site.id,
        min(round(1e3 * reading.distance), unknown - 1),
        round(1e7 * latitude),
        round(1e7 * longitude),
        altitude,
        mavlink.RANGING_BEACON_ALT_TYPE_MSL,
        BEACON_ACCURACY_MM,
        BEACON_ACCURACY_MM,
        0,
        unknown if known.range_sigma is None else round(1e3 * known.range_sigma),
        reading.sequence & 0xFF,
        0,
    )


def gps_raw_int(known: Knowledge) -> Message:
    """Return GPS_RAW_INT; without a fix the last position and stamp with fix type 1, as receivers do."""
    gnss = known.gnss
    if gnss is None:
        return _no_gps(mavlink.GPS_FIX_TYPE_NO_GPS, 0)
    if not known.had_fix:
        return _no_gps(mavlink.GPS_FIX_TYPE_NO_FIX, 0)
    latitude, longitude, altitude = known.origin.geodetic(*gnss.position)
    speed = math.hypot(gnss.velocity[0], gnss.velocity[1])
    course = math.degrees(math.atan2(gnss.velocity[1], gnss.velocity[0])) % 360.0
    return mavlink.MAVLink_gps_raw_int_message(
        known.clock.microseconds(gnss.time),
        mavlink.GPS_FIX_TYPE_3D_FIX if gnss.fix else mavlink.GPS_FIX_TYPE_NO_FIX,
        round(1e7 * latitude),
        round(1e7 * longitude),
        round(1e3 * altitude),
        min(0xFFFF, round(100.0 * gnss.dilution)),
        min(0xFFFF, round(160.0 * gnss.dilution)),
        min(0xFFFE, round(100.0 * speed)),
        round(100.0 * course) % 36_000,
        gnss.satellites,
        round(1e3 * altitude),
        round(1e3 * gnss.accuracy_horizontal),
        round(1e3 * gnss.accuracy_vertical),
        round(1e3 * gnss.accuracy_velocity),
    )


def _no_gps(fix_type: int, stamp: int) -> Message:
    return mavlink.MAVLink_gps_raw_int_message(stamp, fix_type, 0, 0, 0, 0xFFFF, 0xFFFF, 0xFFFF, 0xFFFF, 0)


def scaled_pressure(known: Knowledge) -> Message | None:
    """Return SCALED_PRESSURE: hectopascal, hundredths of a degree Celsius."""
    pressure = known.pressure
    if pressure is None:
        return None
    return mavlink.MAVLink_scaled_pressure_message(
        known.clock.milliseconds(pressure.time),
        0.01 * pressure.pressure,
        0.0,
        round(100.0 * (pressure.temperature - KELVIN_AT_ZERO_CELSIUS)),
    )


def vfr_hud(known: Knowledge) -> Message | None:
    """Return VFR_HUD: speed by the wheels, heading in whole degrees, altitude by the barometer."""
    if known.inertial is None or known.truth is None:
        return None
    altitude = known.origin.altitude
    if known.pressure is not None:
        altitude = standard_altitude(known.pressure.pressure)
    heading = round(math.degrees(known.attitude.yaw)) % 360
    throttle = min(100, max(0, round(100.0 * known.truth.command.speed / FULL_SPEED)))
    return mavlink.MAVLink_vfr_hud_message(0.0, abs(known.speed), heading, throttle, altitude, 0.0)


def system_time(known: Knowledge, time: float) -> Message:
    """Return SYSTEM_TIME; the Unix time is 0 until a receiver has told it."""
    unix = round((known.unix + time) * 1e6) if known.had_fix else 0
    return mavlink.MAVLink_system_time_message(unix, known.clock.milliseconds(time))


def gps_global_origin(known: Knowledge, time: float) -> Message:
    """Return GPS_GLOBAL_ORIGIN: where the autopilot's local frame begins."""
    origin = known.origin
    return mavlink.MAVLink_gps_global_origin_message(
        round(1e7 * origin.latitude),
        round(1e7 * origin.longitude),
        round(1e3 * origin.altitude),
        known.clock.microseconds(time),
    )


FULL_SPEED = 3.0
"""The speed in m/s at which the motors' commands reach their ends."""


def position_target(known: Knowledge, time: float) -> Message | None:
    """Return POSITION_TARGET_LOCAL_NED: velocity, turned north by its own yaw, and yaw rate."""
    if known.truth is None:
        return None
    command, yaw = known.truth.command, known.attitude.yaw
    return mavlink.MAVLink_position_target_local_ned_message(
        known.clock.milliseconds(time),
        mavlink.MAV_FRAME_LOCAL_NED,
        _VELOCITY_AND_YAW_RATE_ONLY,
        0.0,
        0.0,
        0.0,
        command.speed * math.cos(yaw),
        command.speed * math.sin(yaw),
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
        command.yaw_rate,
    )


def servo_output_raw(known: Knowledge, time: float) -> Message | None:
    """Return SERVO_OUTPUT_RAW: pulses of 1000 to 2000 microseconds, left on 1, right on 3; 32-bit stamp."""
    if known.truth is None:
        return None
    command = known.truth.command
    half = 0.5 * known.track * command.yaw_rate
    left, right = (
        round(1500.0 + 500.0 * min(1.0, max(-1.0, speed / FULL_SPEED)))
        for speed in (command.speed + half, command.speed - half)
    )
    stamp = known.clock.microseconds(time) & 0xFFFF_FFFF
    return mavlink.MAVLink_servo_output_raw_message(stamp, 0, left, 0, right, 0, 0, 0, 0, 0)
