"""The autopilot's frames, read back by pymavlink and compared with the truth and the definitions."""

from __future__ import annotations

import math
from collections import defaultdict
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from sim_vehicle.autopilot import Autopilot
from sim_vehicle.clock import BoardClock
from sim_vehicle.geodesy import Origin
from sim_vehicle.rover import Command
from sim_vehicle.sensors import (
    BeaconReading,
    BeaconSite,
    CompassReading,
    GnssReading,
    InertialReading,
    PressureReading,
    WheelReading,
)
from sim_vehicle.telemetry import Knowledge
from sim_vehicle.world import Truth

ORIGIN = Origin(51.0, 4.0, 12.0)
CLOCK = BoardClock(uptime=100.0, drift=1e-5)
UNIX = 1_700_000_000.0


class Bench:
    """An autopilot on a bench: what it sends, decoded as a companion would."""

    def __init__(self, clock: BoardClock = CLOCK) -> None:
        self.raw: list[tuple[float, bytes]] = []
        self.autopilot = Autopilot(
            Knowledge(clock, ORIGIN, UNIX, track=0.5), lambda time, frame: self.raw.append((time, frame))
        )
        self.companion = mavlink.MAVLink(None, srcSystem=1, srcComponent=197)

    def run(self, begin: float, seconds: float) -> None:
        """Let the streams run, with a truth that stands still."""
        while self.autopilot.next_due < begin + seconds - 1e-6:
            self.autopilot.stream(self.autopilot.next_due)

    def feed(self, begin: float, seconds: float) -> None:
        """Let the streams run while the sensors go on reading, 200 times a second."""
        for count in range(round(200 * seconds)):
            time = begin + count / 200.0
            self.autopilot.take_inertial(InertialReading(time, (0.1, 0.2, 0.3), (1.0, 2.0, -9.8)), time)
            self.autopilot.take_wheels(WheelReading(time, time, time), time)
            self.autopilot.take_pressure(PressureReading(time, 101_325.0, 293.15), time)
            self.run(time, 1.0 / 200.0)

    def heard(self) -> dict[str, list[Any]]:
        """Return all messages so far by type, decoded from their bytes by a fresh parser."""
        parser = mavlink.MAVLink(None)
        by_type: defaultdict[str, list[Any]] = defaultdict(list)
        for _, frame in self.raw:
            assert frame[0] == 0xFD, "MAVLink 2"
            assert frame[2] == 0, "unsigned: no incompatibility flags"
            for message in parser.parse_buffer(frame) or []:
                by_type[message.get_type()].append(message)
        return by_type

    def tell(self, message: Any, now: float) -> dict[str, list[Any]]:
        """Say something to the autopilot; return only what it answers."""
        self.raw.clear()
        self.autopilot.receive(bytes(message.pack(self.companion)), now)
        return self.heard()

    def command(self, command: int, *parameters: float, now: float = 0.0) -> int:
        """Send COMMAND_LONG and return the result of its acknowledgement."""
        padded = [*parameters, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0][:7]
        answers = self.tell(mavlink.MAVLink_command_long_message(1, 1, command, 0, *padded), now)
        (acknowledgement,) = answers["COMMAND_ACK"]
        assert acknowledgement.command == command
        assert (acknowledgement.target_system, acknowledgement.target_component) == (1, 197)
        return acknowledgement.result


def truth(command: Command) -> Truth:
    return Truth(1.0, 0.0, 0.0, 0.0, 0.3, 1.0, 0.0, 0.0, 0.0, 0.0, command)


def test_a_passive_listener_hears_the_usual_streams() -> None:
    bench = Bench()
    bench.autopilot.take_truth(truth(Command()))
    bench.feed(0.0, 10.0)
    counts = {kind: len(messages) for kind, messages in bench.heard().items()}
    assert counts == {
        "HEARTBEAT": 10,
        "HIGHRES_IMU": 500,
        "ATTITUDE": 200,
        "WHEEL_DISTANCE": 200,
        "GPS_RAW_INT": 50,
        "SCALED_PRESSURE": 50,
        "VFR_HUD": 40,
        "SYSTEM_TIME": 10,
        "POSITION_TARGET_LOCAL_NED": 100,
        "SERVO_OUTPUT_RAW": 100,
        "GPS_GLOBAL_ORIGIN": 2,
        "TIMESYNC": 10,
    }


def test_frames_come_from_system_1_component_1_with_a_running_sequence() -> None:
    bench = Bench()
    bench.feed(0.0, 3.0)
    sequences = [frame[4] for _, frame in bench.raw]
    assert sequences == [count % 256 for count in range(len(sequences))]
    assert {(frame[5], frame[6]) for _, frame in bench.raw} == {(1, 1)}


def test_highres_imu_says_si_gauss_and_hectopascal_and_what_is_there() -> None:
    bench = Bench()
    bench.autopilot.take_inertial(InertialReading(2.0, (0.01, -0.02, 0.3), (0.5, 0.25, -9.8)), 2.0)
    bench.run(0.0, 0.01)
    (bare,) = bench.heard()["HIGHRES_IMU"]
    assert bare.fields_updated == 0b111111
    assert (bare.xmag, bare.abs_pressure) == (0.0, 0.0)
    bench.raw.clear()
    bench.autopilot.take_compass(CompassReading(2.0, (20e-6, -1e-6, 44e-6)), 2.0)
    bench.autopilot.take_pressure(PressureReading(2.0, 95_000.0, 298.15), 2.0)
    bench.autopilot.take_inertial(InertialReading(2.02, (0.01, -0.02, 0.3), (0.5, 0.25, -9.8)), 2.02)
    bench.run(2.02, 0.01)
    message = bench.heard()["HIGHRES_IMU"][0]
    assert message.time_usec == CLOCK.microseconds(2.02) == 102_020_020
    assert (message.xgyro, message.ygyro, message.zgyro) == pytest.approx((0.01, -0.02, 0.3), rel=1e-6)
    assert (message.xacc, message.yacc, message.zacc) == pytest.approx((0.5, 0.25, -9.8), rel=1e-6)
    assert (message.xmag, message.ymag, message.zmag) == pytest.approx((0.2, -0.01, 0.44), rel=1e-6)
    assert message.abs_pressure == pytest.approx(950.0)
    assert message.temperature == pytest.approx(25.0)
    assert message.fields_updated == 0b1_1011_1111_1111


def test_wheel_distance_is_cumulative_left_then_right() -> None:
    bench = Bench()
    bench.autopilot.take_wheels(WheelReading(1.5, 123.456, 120.25), 1.5)
    bench.run(0.0, 0.01)
    (message,) = bench.heard()["WHEEL_DISTANCE"]
    assert (message.time_usec, message.count) == (101_500_015, 2)
    assert list(message.distance) == [123.456, 120.25, *[0.0] * 14]


def test_ranging_beacon_carries_millimetres_the_place_and_honest_sentinels() -> None:
    bench = Bench()
    bench.autopilot.take_beacon(BeaconReading(3.0, BeaconSite(7, 100.0, -50.0, -2.5), 33.3337, 300), 3.01)
    (message,) = bench.heard()["RANGING_BEACON"]
    assert bench.raw[0][0] == 3.01
    assert message.time_usec == CLOCK.microseconds(3.0)
    assert (message.beacon_id, message.range, message.sequence) == (7, 33_334, 300 % 256)
    latitude, longitude, altitude = ORIGIN.geodetic(100.0, -50.0, -2.5)
    assert (message.lat, message.lon) == (round(latitude * 1e7), round(longitude * 1e7))
    assert message.alt == pytest.approx(altitude, abs=1e-5)
    assert (message.hacc_est, message.vacc_est, message.range_accuracy) == (50, 50, 0xFFFFFFFF)
    bench = Bench()
    bench.autopilot._known.range_sigma = 0.3
    bench.autopilot.take_beacon(BeaconReading(3.0, BeaconSite(7, 0.0, 0.0, 0.0), 5e6, 1), 3.0)
    (message,) = bench.heard()["RANGING_BEACON"]
    assert (message.range_accuracy, message.range) == (300, 0xFFFFFFFE)


def fix(time: float, *, has: bool = True) -> GnssReading:
    return GnssReading(time, has, (10.0, 20.0, -1.0), (0.6, -0.8, 0.0), 0.34, 0.55, 0.08, 14, 0.8)


def test_gps_raw_int_without_a_receiver_without_a_fix_with_one_and_after_it() -> None:
    bench = Bench()
    bench.run(0.0, 0.01)
    (absent,) = bench.heard()["GPS_RAW_INT"]
    assert (absent.fix_type, absent.eph, absent.vel, absent.cog) == (0, 0xFFFF, 0xFFFF, 0xFFFF)
    bench = Bench()
    bench.autopilot.take_gnss(fix(0.0, has=False), 0.0)
    bench.run(0.0, 0.01)
    assert bench.heard()["GPS_RAW_INT"][0].fix_type == 1
    bench.autopilot.take_gnss(fix(4.9), 5.0)
    bench.run(5.0, 0.01)
    message = bench.heard()["GPS_RAW_INT"][-1]
    latitude, longitude, altitude = ORIGIN.geodetic(10.0, 20.0, -1.0)
    assert (message.fix_type, message.time_usec) == (3, CLOCK.microseconds(4.9))
    assert (message.lat, message.lon, message.alt) == (
        round(latitude * 1e7),
        round(longitude * 1e7),
        round(altitude * 1e3),
    )
    assert (message.h_acc, message.v_acc, message.vel_acc) == (340, 550, 80)
    assert (message.vel, message.eph, message.satellites_visible) == (100, 80, 14)
    assert message.cog == round(100.0 * (360.0 - math.degrees(math.atan2(0.8, 0.6))))
    bench.autopilot.take_gnss(fix(4.9, has=False), 6.0)
    bench.run(6.0, 0.01)
    lost = bench.heard()["GPS_RAW_INT"][-1]
    assert (lost.fix_type, lost.time_usec, lost.lat) == (1, message.time_usec, message.lat)


def test_system_time_is_told_only_after_a_fix() -> None:
    bench = Bench()
    bench.run(0.0, 0.01)
    bench.autopilot.take_gnss(fix(0.9), 1.0)
    bench.run(1.0, 0.01)
    before, after = bench.heard()["SYSTEM_TIME"][0], bench.heard()["SYSTEM_TIME"][-1]
    assert (before.time_unix_usec, before.time_boot_ms) == (0, 100_000)
    assert (after.time_unix_usec, after.time_boot_ms) == (1_700_000_001_000_000, 101_000)


def test_attitude_and_the_head_up_display_follow_the_compass() -> None:
    bench = Bench()
    heading = -2.0
    field = (20e-6 * math.cos(heading), -20e-6 * math.sin(heading), 44e-6)
    bench.autopilot.take_compass(CompassReading(0.0, field), 0.0)
    bench.autopilot.take_truth(truth(Command(1.5)))
    bench.autopilot.take_wheels(WheelReading(0.0, 0.0, 0.0), 0.0)
    bench.autopilot.take_wheels(WheelReading(0.02, 0.021, 0.019), 0.02)
    bench.autopilot.take_inertial(InertialReading(0.0, (0.0, 0.0, 0.1), (0.0, 0.0, -9.8)), 0.0)
    bench.run(0.0, 0.01)
    heard = bench.heard()
    assert heard["ATTITUDE"][0].yaw == pytest.approx(heading)
    assert heard["ATTITUDE"][0].yawspeed == pytest.approx(0.1)
    assert heard["VFR_HUD"][0].heading == round(360.0 + math.degrees(heading))
    assert heard["VFR_HUD"][0].groundspeed == pytest.approx(1.0)
    assert heard["VFR_HUD"][0].throttle == 50


def test_the_control_messages_carry_the_command() -> None:
    bench = Bench()
    bench.autopilot.take_truth(truth(Command(1.5, 0.4)))
    bench.autopilot.take_compass(CompassReading(0.0, (0.0, -20e-6, 44e-6)), 0.0)
    bench.run(0.0, 0.01)
    (target,) = bench.heard()["POSITION_TARGET_LOCAL_NED"]
    assert (target.vx, target.vy, target.yaw_rate) == pytest.approx((0.0, 1.5, 0.4), abs=1e-7)
    ignored = target.type_mask
    for name in ("X", "Y", "Z", "AX", "AY", "AZ", "YAW"):
        assert ignored & getattr(mavlink, f"POSITION_TARGET_TYPEMASK_{name}_IGNORE")
    for name in ("VX", "VY", "VZ", "YAW_RATE"):
        assert not ignored & getattr(mavlink, f"POSITION_TARGET_TYPEMASK_{name}_IGNORE")
    (servo,) = bench.heard()["SERVO_OUTPUT_RAW"]
    assert (servo.servo1_raw, servo.servo3_raw) == (round(1500 + 500 * 1.6 / 3), round(1500 + 500 * 1.4 / 3))


def test_the_servo_stamp_wraps_in_71_minutes() -> None:
    bench = Bench(BoardClock(uptime=2**32 / 1e6 - 0.05))
    bench.autopilot.take_truth(truth(Command()))
    bench.run(0.0, 0.15)
    stamps = [message.time_usec for message in bench.heard()["SERVO_OUTPUT_RAW"]]
    assert stamps[0] == pytest.approx(2**32 - 50_000, abs=1)
    assert stamps[1] == pytest.approx(50_000, abs=1)


def test_timesync_is_answered_with_its_own_clock_and_the_askers_stamp() -> None:
    bench = Bench()
    answers = bench.tell(mavlink.MAVLink_timesync_message(0, 987_654_321), 10.0)
    (answer,) = answers["TIMESYNC"]
    assert (answer.tc1, answer.ts1) == (CLOCK.nanoseconds(10.0), 987_654_321)
    assert bench.tell(mavlink.MAVLink_timesync_message(5, 987_654_321), 10.0) == {}


def test_an_interval_changes_the_rate_and_stops_it_and_brings_the_default_back() -> None:
    bench = Bench()
    number = mavlink.MAVLINK_MSG_ID_HIGHRES_IMU
    for interval, expected in ((10_000.0, 100), (-1.0, 0), (0.0, 50)):
        assert (
            bench.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, interval)
            == mavlink.MAV_RESULT_ACCEPTED
        )
        bench.raw.clear()
        bench.feed(0.0, 1.0)
        assert len(bench.heard()["HIGHRES_IMU"]) == expected


def test_no_stream_is_faster_than_the_loop_allows_nor_than_its_sensor() -> None:
    bench = Bench()
    bench.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, 100.0)
    bench.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_HIGHRES_IMU, 1000.0)
    bench.raw.clear()
    bench.feed(0.0, 1.0)
    assert len(bench.heard()["GPS_RAW_INT"]) == 320
    assert len(bench.heard()["HIGHRES_IMU"]) == 200


def test_wheel_distance_refuses_an_interval_and_obeys_a_data_stream() -> None:
    bench = Bench()
    number = mavlink.MAVLINK_MSG_ID_WHEEL_DISTANCE
    assert bench.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, 20_000.0) == mavlink.MAV_RESULT_DENIED
    assert bench.autopilot.refused == {"interval of message 9000": 1}
    for begin, start, expected in ((0.0, 1, 25), (1.0, 0, 0)):
        bench.tell(mavlink.MAVLink_request_data_stream_message(1, 1, 10, 25, start), begin)
        bench.raw.clear()
        bench.feed(begin, 1.0)
        assert len(bench.heard()["WHEEL_DISTANCE"]) == expected
        assert len(bench.heard()["HIGHRES_IMU"]) == 50


def test_beacons_can_be_turned_off_and_unknown_messages_are_denied() -> None:
    bench = Bench()
    reading = BeaconReading(0.0, BeaconSite(0, 1.0, 1.0, 0.0), 5.0, 1)
    assert bench.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 513, -1.0) == mavlink.MAV_RESULT_ACCEPTED
    bench.raw.clear()
    bench.autopilot.take_beacon(reading, 0.0)
    assert bench.raw == []
    assert bench.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 513, 100_000.0) == mavlink.MAV_RESULT_ACCEPTED
    bench.raw.clear()
    bench.autopilot.take_beacon(reading, 0.0)
    assert len(bench.raw) == 1
    assert bench.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 331, 1000.0) == mavlink.MAV_RESULT_DENIED
    assert bench.command(mavlink.MAV_CMD_NAV_LAND) == mavlink.MAV_RESULT_UNSUPPORTED


def test_the_origin_comes_on_request() -> None:
    bench = Bench()
    request = mavlink.MAV_CMD_REQUEST_MESSAGE
    assert bench.command(request, mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN) == mavlink.MAV_RESULT_ACCEPTED
    (origin,) = bench.heard()["GPS_GLOBAL_ORIGIN"]
    assert (origin.latitude, origin.longitude, origin.altitude) == (510_000_000, 40_000_000, 12_000)
    assert bench.command(request, mavlink.MAVLINK_MSG_ID_WHEEL_DISTANCE) == mavlink.MAV_RESULT_DENIED


def test_what_is_for_others_is_not_answered_and_garbage_is_counted() -> None:
    bench = Bench()
    other = mavlink.MAVLink_command_long_message(
        2, 1, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 0, 105, 1e4, 0, 0, 0, 0, 0
    )
    assert bench.tell(other, 0.0) == {}
    spoilt = bytearray(mavlink.MAVLink_timesync_message(0, 1).pack(bench.companion))
    spoilt[-1] ^= 0xFF
    bench.raw.clear()
    bench.autopilot.receive(bytes(spoilt) + b"garbage" * 3, 0.0)
    assert bench.raw == []
    assert bench.autopilot.refused["malformed"] > 0
    assert len(bench.tell(mavlink.MAVLink_timesync_message(0, 1), 0.0)["TIMESYNC"]) == 1
