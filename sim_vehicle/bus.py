"""What is on the rover's CAN bus: DroneCAN nodes for receiver, inertial unit, motors and a range finder.

Each node broadcasts what its sensor last read, and a NodeStatus once a second. The nodes' clocks are not
synchronised: a timestamp counts from the node's own boot. GNSS time is UTC.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from sim_vehicle.dsdl import Node, message
from sim_vehicle.fitting import BusSettings
from sim_vehicle.frame import CanFrame
from sim_vehicle.geodesy import Origin
from sim_vehicle.rover import Rover
from sim_vehicle.sensors import (
    CompassReading,
    GnssReading,
    InertialReading,
    PressureReading,
)
from sim_vehicle.telemetry import FULL_SPEED, GAUSS_PER_TESLA
from sim_vehicle.world import Truth

UTC = 2
"""gnss.Fix2.gnss_time_standard."""
_ESC_FULL_SCALE = 8191
_UNITLESS_COMMAND = 0
"""actuator.Command.command_type: a share of full speed, -1 to 1."""
_LIDAR, _READING_VALID, _DOWNWARD = 2, 1, (0, -6, 0)
"""range_sensor.Measurement: sensor and reading type; roll, pitch, yaw of the beam in steps of 15 degrees."""


class Bus:
    """The nodes of the bus.

    Parameters
    ----------
    settings : BusSettings
        What is fitted.
    origin, unix : Origin, float
        The site; Unix seconds when the drive began.
    send : Callable[[float, CanFrame], None]
        Takes every frame with the time at which it leaves.
    """

    def __init__(
        self, settings: BusSettings, origin: Origin, unix: float, send: Callable[[float, CanFrame], None]
    ) -> None:
        self._settings = settings
        self._origin = origin
        self._unix = unix
        self._send = send
        self._autopilot, self._sensors, self._left, self._right = Node(10), Node(42), Node(51), Node(52)

    def _broadcast(self, now: float, node: Node, value: Any) -> None:
        for frame in node.frames(value):
            self._send(now, frame)

    def _stamp(self, time: float) -> Any:
        return message("uavcan.Timestamp", usec=self._settings.clock.microseconds(time))

    def take_gnss(self, reading: GnssReading, now: float) -> None:
        """Broadcast gnss.Fix2: 1e-8 degrees, millimetres, the six variances of position and velocity."""
        latitude, longitude, altitude = self._origin.geodetic(*reading.position)
        fix = message("uavcan.equipment.gnss.Fix2")
        fix.timestamp = self._stamp(now)
        if reading.satellites or reading.accuracy_horizontal:
            fix.gnss_timestamp = message("uavcan.Timestamp", usec=round((self._unix + reading.time) * 1e6))
            fix.gnss_time_standard = UTC
            fix.num_leap_seconds = 18
            fix.longitude_deg_1e8 = round(1e8 * longitude)
            fix.latitude_deg_1e8 = round(1e8 * latitude)
            fix.height_ellipsoid_mm = fix.height_msl_mm = round(1e3 * altitude)
        if reading.fix:
            fix.timestamp = self._stamp(reading.time)
            fix.ned_velocity = list(reading.velocity)
            horizontal, vertical = reading.accuracy_horizontal**2, reading.accuracy_vertical**2
            fix.covariance = [horizontal, horizontal, vertical, *[reading.accuracy_velocity**2] * 3]
        fix.sats_used = reading.satellites
        fix.status = 3 if reading.fix else 0
        fix.pdop = min(99.99, 1.9 * reading.dilution)
        self._broadcast(now, self._sensors, fix)

    def take_inertial(self, reading: InertialReading, now: float) -> None:
        """Broadcast ahrs.RawIMU: latest rates and specific forces, and the integrals of one interval."""
        interval = 1.0 / self._settings.inertial.cadence.rate if self._settings.inertial else 0.0
        value = message(
            "uavcan.equipment.ahrs.RawIMU",
            integration_interval=interval,
            rate_gyro_latest=list(reading.angular_velocity),
            rate_gyro_integral=[interval * rate for rate in reading.angular_velocity],
            accelerometer_latest=list(reading.specific_force),
            accelerometer_integral=[interval * force for force in reading.specific_force],
        )
        value.timestamp = self._stamp(reading.time)
        self._broadcast(now, self._sensors, value)

    def take_compass(self, reading: CompassReading, now: float) -> None:
        """Broadcast ahrs.MagneticFieldStrength2, gauss."""
        field = [GAUSS_PER_TESLA * axis for axis in reading.field]
        self._broadcast(
            now,
            self._sensors,
            message("uavcan.equipment.ahrs.MagneticFieldStrength2", magnetic_field_ga=field),
        )

    def take_pressure(self, reading: PressureReading, now: float) -> None:
        """Broadcast air_data.StaticPressure, pascal."""
        noise = self._settings.barometer.noise if self._settings.barometer else 0.0
        value = message(
            "uavcan.equipment.air_data.StaticPressure",
            static_pressure=reading.pressure,
            static_pressure_variance=noise**2,
        )
        self._broadcast(now, self._sensors, value)

    def clearance(self, now: float) -> None:
        """Broadcast range_sensor.Measurement: a laser that looks at flat ground."""
        value = message(
            "uavcan.equipment.range_sensor.Measurement",
            sensor_id=0,
            field_of_view=0.05,
            sensor_type=_LIDAR,
            reading_type=_READING_VALID,
            range=self._settings.clearance,
        )
        value.timestamp = self._stamp(now)
        value.beam_orientation_in_body_frame.fixed_axis_roll_pitch_yaw = list(_DOWNWARD)
        value.beam_orientation_in_body_frame.orientation_defined = True
        self._broadcast(now, self._sensors, value)

    def motors(self, now: float, truth: Truth, rover: Rover, track: float) -> None:
        """Broadcast the motors' revolutions (esc.Status) and their commands (RawCommand, ArrayCommand)."""
        per_second = 1.0 / (math.tau * self._settings.wheel_radius)
        for index, (node, speed) in enumerate(
            zip((self._left, self._right), rover.wheel_speeds(truth.motion), strict=True)
        ):
            value = message(
                "uavcan.equipment.esc.Status",
                voltage=24.6,
                current=0.5 + 2.0 * abs(speed),
                temperature=308.0,
                rpm=round(60.0 * speed * per_second),
                power_rating_pct=min(100, round(100.0 * abs(speed) / FULL_SPEED)),
                esc_index=index,
            )
            self._broadcast(now, node, value)
        command, half = truth.command, 0.5 * track * truth.command.yaw_rate
        asked = (command.speed + half, command.speed - half)
        shares = [min(1.0, max(-1.0, speed / FULL_SPEED)) for speed in asked]
        raw = [round(_ESC_FULL_SCALE * share) for share in shares]
        self._broadcast(now, self._autopilot, message("uavcan.equipment.esc.RawCommand", cmd=raw))
        actuators = [
            message(
                "uavcan.equipment.actuator.Command",
                actuator_id=index,
                command_type=_UNITLESS_COMMAND,
                command_value=share,
            )
            for index, share in enumerate(shares)
        ]
        self._broadcast(
            now, self._autopilot, message("uavcan.equipment.actuator.ArrayCommand", commands=actuators)
        )

    def status(self, now: float) -> None:
        """Broadcast every node's NodeStatus: operational, healthy, its uptime."""
        uptime = self._settings.clock.nanoseconds(now) // 1_000_000_000
        nodes = [
            self._autopilot,
            self._sensors,
            *([self._left, self._right] if self._settings.motor_rate else []),
        ]
        for node in nodes:
            self._broadcast(
                now, node, message("uavcan.protocol.NodeStatus", uptime_sec=uptime, health=0, mode=0)
            )
