"""The autopilot's MAVLink face: streams its telemetry, answers companions, as ArduPilot's rover does.

Until anybody asks, every message streams at a default rate. SET_MESSAGE_INTERVAL changes one message's rate
and is refused for WHEEL_DISTANCE, which obeys REQUEST_DATA_STREAM instead, as on the real one. Frames are
MAVLink 2, unsigned, from system 1, component 1; stamps count from the autopilot's own boot.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, cast

from pymavlink.dialects.v20 import all as mavlink

from sim_vehicle import telemetry
from sim_vehicle.sensors import (
    BeaconReading,
    CompassReading,
    GnssReading,
    InertialReading,
    PressureReading,
    WheelReading,
)
from sim_vehicle.telemetry import Knowledge, Message
from sim_vehicle.world import Truth

SYSTEM = 1
COMPONENT = 1
FASTEST_RATE = 320.0
"""Messages per second that one stream can reach: 0.8 of the autopilot's loop of 400 Hz."""

_STREAM_RAW_SENSORS, _STREAM_STATUS, _STREAM_CHANNELS, _STREAM_EXTRA1, _STREAM_EXTRA2, _STREAM_EXTRA3 = (
    1,
    2,
    3,
    10,
    11,
    12,
)


@dataclass(slots=True)
class Stream:
    """One periodic message: how to say it, how often, and in which of ArduPilot's stream groups it lies."""

    say: Callable[[Knowledge, float], Message | None]
    rate: float
    group: int | None
    by_interval: bool = True
    next: float = 0.0
    default: float = field(init=False)

    def __post_init__(self) -> None:
        """Keep the rate that the vehicle was built with."""
        self.default = self.rate

    def set_rate(self, rate: float, now: float) -> None:
        """Stream at ``rate`` from now on; 0 stops it."""
        self.rate = min(rate, FASTEST_RATE)
        self.next = now


def _streams() -> dict[int, Stream]:
    return {
        mavlink.MAVLINK_MSG_ID_HEARTBEAT: Stream(lambda _known, _time: telemetry.heartbeat(), 1.0, None),
        mavlink.MAVLINK_MSG_ID_HIGHRES_IMU: Stream(
            lambda known, _time: telemetry.highres_imu(known), 50.0, _STREAM_RAW_SENSORS
        ),
        mavlink.MAVLINK_MSG_ID_ATTITUDE: Stream(
            lambda known, _time: telemetry.attitude(known), 20.0, _STREAM_EXTRA1
        ),
        mavlink.MAVLINK_MSG_ID_WHEEL_DISTANCE: Stream(
            lambda known, _time: telemetry.wheel_distance(known), 20.0, _STREAM_EXTRA1, by_interval=False
        ),
        mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: Stream(
            lambda known, _time: telemetry.gps_raw_int(known), 5.0, _STREAM_STATUS
        ),
        mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE: Stream(
            lambda known, _time: telemetry.scaled_pressure(known), 5.0, _STREAM_RAW_SENSORS
        ),
        mavlink.MAVLINK_MSG_ID_VFR_HUD: Stream(
            lambda known, _time: telemetry.vfr_hud(known), 4.0, _STREAM_EXTRA2
        ),
        mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: Stream(telemetry.system_time, 1.0, _STREAM_EXTRA3),
        mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: Stream(
            telemetry.position_target, 10.0, _STREAM_STATUS
        ),
        mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: Stream(telemetry.servo_output_raw, 10.0, _STREAM_CHANNELS),
        mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: Stream(telemetry.gps_global_origin, 0.2, None),
        mavlink.MAVLINK_MSG_ID_TIMESYNC: Stream(_ask_time, 1.0, None, by_interval=False),
    }


def _ask_time(known: Knowledge, time: float) -> Message:
    return mavlink.MAVLink_timesync_message(0, known.clock.nanoseconds(time))


class Autopilot:
    """The autopilot: takes readings, speaks and answers MAVLink.

    Parameters
    ----------
    knowledge : Knowledge
        Its clock and site, and the readings as they come in.
    send : Callable[[float, bytes], None]
        Takes every frame with the time at which it leaves, seconds since the drive began.
    """

    def __init__(self, knowledge: Knowledge, send: Callable[[float, bytes], None]) -> None:
        self._known = knowledge
        self._send = send
        self._streams = _streams()
        self._beacons_wanted = True
        self._codec = mavlink.MAVLink(None, srcSystem=SYSTEM, srcComponent=COMPONENT)
        self._codec.robust_parsing = True
        self._new: set[int] = set()
        self.refused: Counter[str] = Counter()

    @property
    def next_due(self) -> float:
        """When the next message of a stream is due, seconds since the drive began."""
        return min(stream.next for stream in self._streams.values() if stream.rate > 0.0)

    def stream(self, now: float) -> None:
        """Send what is due."""
        for number, stream in self._streams.items():
            if stream.rate <= 0.0 or stream.next > now + 1e-9:
                continue
            stream.next += 1.0 / stream.rate
            if number in _SENSOR_OF and number not in self._new:
                continue
            self._new.discard(number)
            self._say(stream.say(self._known, now), now)

    def take_truth(self, truth: Truth) -> None:
        """Take the driver's command with the moment's truth: control messages speak of nothing else in it."""
        self._known.truth = truth

    def take_wheels(self, reading: WheelReading, _now: float) -> None:
        """Take a reading of the encoders, and make a speed of it and the one before."""
        before = self._known.wheels
        if before is not None and reading.time > before.time:
            rolled = 0.5 * (reading.left - before.left + reading.right - before.right)
            self._known.speed = rolled / (reading.time - before.time)
        self._known.wheels = reading
        self._new.add(mavlink.MAVLINK_MSG_ID_WHEEL_DISTANCE)

    def take_inertial(self, reading: InertialReading, _now: float) -> None:
        """Take a reading of the inertial unit."""
        self._known.inertial = reading
        self._known.attitude.turn(reading.time, reading.angular_velocity[2])
        self._new.update((mavlink.MAVLINK_MSG_ID_HIGHRES_IMU, mavlink.MAVLINK_MSG_ID_ATTITUDE))

    def take_compass(self, reading: CompassReading, _now: float) -> None:
        """Take a reading of the magnetometer."""
        self._known.compass = reading
        self._known.attitude.align(reading.time, reading.heading(self._known.declination))

    def take_pressure(self, reading: PressureReading, _now: float) -> None:
        """Take a reading of the barometer."""
        self._known.pressure = reading
        self._new.add(mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE)

    def take_gnss(self, reading: GnssReading, _now: float) -> None:
        """Take what the satellite receiver says."""
        self._known.gnss = reading
        self._known.had_fix = self._known.had_fix or reading.fix

    def take_beacon(self, reading: BeaconReading, now: float) -> None:
        """Take a range and pass it on at once."""
        if self._beacons_wanted:
            self._say(telemetry.ranging_beacon(self._known, reading), now)

    def receive(self, data: bytes, now: float) -> None:
        """Understand bytes from a companion and answer them."""
        for message in cast("list[Any] | None", self._codec.parse_buffer(data)) or ():
            kind = str(message.get_type())
            if kind == "BAD_DATA":
                self.refused["malformed"] += 1
                continue
            if _is_for_us(message):
                self._answer(kind, message, now)

    def _answer(self, kind: str, message: Any, now: float) -> None:
        if kind == "TIMESYNC":
            self._answer_timesync(message, now)
        elif kind == "COMMAND_LONG":
            self._answer_command(message, now)
        elif kind == "REQUEST_DATA_STREAM":
            self._answer_data_stream(message, now)

    def _say(self, message: Message | None, now: float) -> None:
        if message is None:
            return
        frame = bytes(message.pack(self._codec))
        self._codec.seq = (self._codec.seq + 1) % 256
        self._send(now, frame)

    def _answer_timesync(self, message: Any, now: float) -> None:
        if message.tc1 == 0:
            self._say(mavlink.MAVLink_timesync_message(self._known.clock.nanoseconds(now), message.ts1), now)

    def _answer_command(self, message: Any, now: float) -> None:
        if message.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            result = self._set_interval(int(message.param1), float(message.param2), now)
        elif message.command == mavlink.MAV_CMD_REQUEST_MESSAGE:
            result = self._send_once(int(message.param1), now)
        else:
            result = mavlink.MAV_RESULT_UNSUPPORTED
        acknowledgement = mavlink.MAVLink_command_ack_message(
            message.command, result, 0, 0, message.get_srcSystem(), message.get_srcComponent()
        )
        self._say(acknowledgement, now)

    def _set_interval(self, number: int, interval_us: float, now: float) -> int:
        if number == mavlink.MAVLINK_MSG_ID_RANGING_BEACON:
            self._beacons_wanted = interval_us >= 0.0
            return mavlink.MAV_RESULT_ACCEPTED
        stream = self._streams.get(number)
        if stream is None or not stream.by_interval:
            self.refused[f"interval of message {number}"] += 1
            return mavlink.MAV_RESULT_DENIED
        if interval_us < 0.0:
            stream.set_rate(0.0, now)
        elif interval_us == 0.0:
            stream.set_rate(stream.default, now)
        else:
            stream.set_rate(1e6 / interval_us, now)
        return mavlink.MAV_RESULT_ACCEPTED

    def _send_once(self, number: int, now: float) -> int:
        stream = self._streams.get(number)
        message = None if stream is None else stream.say(self._known, now)
        if message is None:
            return mavlink.MAV_RESULT_DENIED
        self._say(message, now)
        return mavlink.MAV_RESULT_ACCEPTED

    def _answer_data_stream(self, message: Any, now: float) -> None:
        rate = float(message.req_message_rate) if message.start_stop else 0.0
        for stream in self._streams.values():
            if stream.group is not None and message.req_stream_id in (
                mavlink.MAV_DATA_STREAM_ALL,
                stream.group,
            ):
                stream.set_rate(rate, now)


def _is_for_us(message: Any) -> bool:
    system, component = getattr(message, "target_system", 0), getattr(message, "target_component", 0)
    return system in (0, SYSTEM) and component in (0, COMPONENT)


_SENSOR_OF = frozenset(
    (
        mavlink.MAVLINK_MSG_ID_HIGHRES_IMU,
        mavlink.MAVLINK_MSG_ID_ATTITUDE,
        mavlink.MAVLINK_MSG_ID_WHEEL_DISTANCE,
        mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE,
    )
)
"""Messages that are skipped when their sensor has said nothing new since the last one."""
