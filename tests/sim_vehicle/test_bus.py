"""The bus's frames, decoded again by the dronecan package, and one transfer packed by hand."""

from __future__ import annotations

import struct
from collections import defaultdict
from typing import Any

import pytest
from dronecan import transport

from sim_vehicle.bus import Bus
from sim_vehicle.clock import BoardClock
from sim_vehicle.dsdl import Node, message
from sim_vehicle.fitting import BusSettings
from sim_vehicle.frame import CanFrame
from sim_vehicle.geodesy import Origin
from sim_vehicle.rover import Command, SkidRover
from sim_vehicle.sensors import (
    BarometerSettings,
    Cadence,
    CompassReading,
    GnssReading,
    InertialReading,
    InertialSettings,
    PressureReading,
)
from sim_vehicle.wire import WireSettings
from sim_vehicle.world import Truth

ORIGIN = Origin(51.0, 4.0, 12.0)
CLOCK = BoardClock(uptime=50.0)
UNIX = 1_700_000_000.0


class Bench:
    """A bus whose frames are collected and decoded as a listener would."""

    def __init__(self) -> None:
        self.frames: list[CanFrame] = []
        settings = BusSettings(
            WireSettings(),
            clock=CLOCK,
            inertial=InertialSettings(Cadence(50.0)),
            barometer=BarometerSettings(Cadence(10.0), noise=3.0),
            motor_rate=10.0,
            wheel_radius=0.1,
            clearance=0.35,
        )
        self.bus = Bus(settings, ORIGIN, UNIX, lambda _time, frame: self.frames.append(frame))

    def heard(self) -> list[tuple[int, int, Any]]:
        """Return (node, data type, payload) of every transfer."""
        transfers: defaultdict[int, list[Any]] = defaultdict(list)
        heard: list[tuple[int, int, Any]] = []
        for frame in self.frames:
            assert frame.extended
            assert 1 <= len(frame.data) <= 8
            parts = transfers[frame.identifier]
            parts.append(transport.Frame(frame.identifier, frame.data))
            if frame.data[-1] & 0x40:
                transfer = transport.Transfer()
                transfer.from_frames(parts)
                heard.append((transfer.source_node_id, transfer.data_type_id, transfer.payload))
                parts.clear()
        assert not any(transfers.values()), "a transfer without its end"
        self.frames.clear()
        return heard


def test_fix2_says_where_how_fast_and_how_well() -> None:
    bench = Bench()
    reading = GnssReading(4.9, True, (10.0, 20.0, -1.0), (0.6, -0.8, 0.1), 0.3, 0.5, 0.08, 14, 0.8)
    bench.bus.take_gnss(reading, 5.0)
    assert len(bench.frames) >= 9
    ((node, kind, fix),) = bench.heard()
    latitude, longitude, altitude = ORIGIN.geodetic(10.0, 20.0, -1.0)
    assert (node, kind, fix.status, fix.sats_used) == (42, 1063, 3, 14)
    assert (fix.latitude_deg_1e8, fix.longitude_deg_1e8) == (round(latitude * 1e8), round(longitude * 1e8))
    assert fix.height_msl_mm == round(altitude * 1e3)
    assert list(fix.ned_velocity) == pytest.approx([0.6, -0.8, 0.1])
    assert list(fix.covariance) == pytest.approx([0.09, 0.09, 0.25, *[0.0064] * 3], rel=1e-3)
    assert fix.timestamp.usec == CLOCK.microseconds(4.9)
    assert fix.gnss_timestamp.usec == round((UNIX + 4.9) * 1e6)
    assert (fix.gnss_time_standard, fix.num_leap_seconds) == (2, 18)


def test_fix2_without_a_fix_says_so_and_repeats_the_last_position() -> None:
    bench = Bench()
    bench.bus.take_gnss(
        GnssReading(4.9, False, (10.0, 20.0, 0.0), (0.0, 0.0, 0.0), 0.3, 0.5, 0.1, 0, 99.99), 9.0
    )
    ((_, _, fix),) = bench.heard()
    assert (fix.status, fix.sats_used, list(fix.covariance)) == (0, 0, [])
    assert fix.latitude_deg_1e8 == round(1e8 * ORIGIN.geodetic(10.0, 20.0, 0.0)[0])
    assert fix.gnss_timestamp.usec == round((UNIX + 4.9) * 1e6)


def test_the_other_sensors_survive_the_half_floats() -> None:
    bench = Bench()
    bench.bus.take_inertial(InertialReading(1.0, (0.01, -0.02, 0.3), (0.5, 0.25, -9.8)), 1.0)
    bench.bus.take_compass(CompassReading(1.0, (20e-6, -1e-6, 44e-6)), 1.0)
    bench.bus.take_pressure(PressureReading(1.0, 95_012.5, 293.15), 1.0)
    bench.bus.clearance(1.0)
    (_, imu_kind, imu), (_, mag_kind, mag), (_, baro_kind, baro), (_, range_kind, clearance) = bench.heard()
    assert (imu_kind, mag_kind, baro_kind, range_kind) == (1003, 1002, 1028, 1050)
    assert list(imu.rate_gyro_latest) == pytest.approx([0.01, -0.02, 0.3], rel=1e-3)
    assert list(imu.accelerometer_latest) == pytest.approx([0.5, 0.25, -9.8], rel=1e-3)
    assert imu.integration_interval == pytest.approx(0.02)
    assert list(imu.rate_gyro_integral) == pytest.approx([0.0002, -0.0004, 0.006])
    assert imu.timestamp.usec == 51_000_000
    assert list(mag.magnetic_field_ga) == pytest.approx([0.2, -0.01, 0.44], rel=1e-3)
    assert (baro.static_pressure, baro.static_pressure_variance) == pytest.approx((95_012.5, 9.0))
    assert clearance.range == pytest.approx(0.35, rel=1e-3)
    assert (clearance.sensor_type, clearance.reading_type) == (2, 1)


def test_motors_say_their_revolutions_and_what_they_were_asked() -> None:
    bench = Bench()
    truth = Truth(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.2, 0.0, 0.0, 0.0, Command(1.5, 0.4))
    bench.bus.motors(1.0, truth, SkidRover(track=1.0, turning_slip=1.0), track=0.5)
    left, right, raw, array = bench.heard()
    assert [(item[0], item[1]) for item in (left, right, raw, array)] == [
        (51, 1034),
        (52, 1034),
        (10, 1030),
        (10, 1010),
    ]
    assert [(item[2].esc_index, item[2].rpm) for item in (left, right)] == [(0, 105), (1, 86)]
    assert list(raw[2].cmd) == [round(8191 * 1.6 / 3.0), round(8191 * 1.4 / 3.0)]
    assert [command.actuator_id for command in array[2].commands] == [0, 1]
    shares = [command.command_value for command in array[2].commands]
    assert shares == pytest.approx([1.6 / 3.0, 1.4 / 3.0], rel=1e-3)
    assert {command.command_type for command in array[2].commands} == {0}


def test_every_node_says_that_it_is_well() -> None:
    bench = Bench()
    bench.bus.status(3.5)
    heard = bench.heard()
    assert [node for node, _, _ in heard] == [10, 42, 51, 52]
    assert all((kind, status.uptime_sec, status.health) == (341, 53, 0) for _, kind, status in heard)


def test_a_single_frame_transfer_is_as_packed_by_hand() -> None:
    """NodeStatus: uptime (4 bytes), health, mode, sub mode (1), vendor code (2), tail 0xC0 + transfer."""
    status = message(
        "uavcan.protocol.NodeStatus", uptime_sec=0x01020304, health=0, mode=0, vendor_specific_status_code=0
    )
    node = Node(42)
    for transfer in range(34):
        (frame,) = node.frames(status)
        assert frame.identifier == (16 << 24) | (341 << 8) | 42
        assert frame.data == struct.pack("<IBHB", 0x01020304, 0, 0, 0xC0 | transfer % 32)


def test_a_node_has_a_number_from_1_to_127() -> None:
    with pytest.raises(ValueError, match="from 1 to 127, got 128"):
        Node(128)
    with pytest.raises(KeyError):
        message("uavcan.equipment.no.Such")
