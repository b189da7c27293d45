"""ULog files: written by hand, read as pyulog reads them, and damaged in every way."""

from __future__ import annotations

import io
import math
import struct
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pyulog import ULog

from drivers.logs import LogReader
from drivers.logs.ulog import UlogReader
from drivers.sample import (
    AnyReading,
    Attitude,
    Clearance,
    GeodeticPosition,
    Heading,
    Inertial,
    MotorSpeed,
    Origin,
    Pressure,
    Range,
    Sample,
    Velocity,
)
from tests.drivers.logs import ulog

START = ulog.START
NAN = math.nan


def read(path: Path, *parts: bytes) -> tuple[list[Sample], UlogReader]:
    path.write_bytes(b"".join(parts))
    reader = UlogReader(path, "autopilot")
    return list(reader), reader


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "flight.ulg"


def readings(path: Path, *parts: bytes) -> list[AnyReading]:
    return [sample.reading for sample in read(path, ulog.header(), ulog.definitions(), *parts)[0]]


def test_samples_in_order_on_the_clock_since_boot(path: Path) -> None:
    log = [ulog.combined(START + 5_000 * i) for i in range(5)]
    samples, reader = read(path, ulog.header(), ulog.definitions(), *log, ulog.data("cpuload", START, 0.5))
    assert [s.received for s in samples] == [(START + 5_000 * i) * 1_000 for i in range(5)]
    assert samples[0].reading == Inertial((0.5, 0.25, 0.125), (1.0, 2.0, -9.5))
    assert {(s.link, s.source) for s in samples} == {("autopilot", "sensor_combined")}
    report = reader.report()
    assert (report.messages, report.samples, report.malformed, report.ignored) == (5, 5, {}, 1)
    assert report.clock == "boot"
    assert reader.kinds() == {"sensor_combined": 5, "cpuload": 1}
    assert reader.position == reader.size
    assert list(reader) == samples
    log_reader: LogReader = reader
    assert log_reader.report() == report


def test_with_a_fix_the_clock_is_unix_time(path: Path) -> None:
    utc = 1_700_000_000_000_000
    samples, reader = read(
        path,
        ulog.header(),
        ulog.definitions(),
        ulog.combined(START),
        ulog.gps(START + 200_000, utc + 200_000),
    )
    assert samples[0].received == utc * 1_000
    assert samples[1].received - samples[1].time == 100_000_000  # timestamp_sample
    assert reader.report().clock == "utc"


def test_a_fix(path: Path) -> None:
    position, velocity, heading = readings(path, ulog.gps(START, 1, heading=-3.5))
    assert position == GeodeticPosition(math.radians(47.5), math.radians(8.5), 400.0, 0.75, 1.5, 12)
    assert velocity == Velocity(3.0, 4.0, -1.0, 0.25)
    assert isinstance(heading, Heading)
    assert (heading.heading, heading.sigma) == (pytest.approx(math.tau - 3.5), None)


def test_the_older_fix_in_whole_numbers(path: Path) -> None:
    log = ulog.data(
        "sensor_gps", START, 5, 475_000_000, 85_000_000, 400_500, 0.5, 0.5, 1.0, 2.0, 3.0, 2, 7, False
    )
    (position,) = readings(path, log)
    assert position == GeodeticPosition(math.radians(47.5), math.radians(8.5), None, 0.5, None, 7)


def test_the_receiver_is_not_used_beside_the_blend_of_it(path: Path) -> None:
    raw = ulog.data("sensor_gps", START, 5, 1, 1, 1, 0.5, 0.5, 1.0, 2.0, 3.0, 3, 7, True)
    log = (ulog.header(), ulog.definitions(), raw, ulog.gps(START + 1, 1_700_000_000_000_000))
    samples, reader = read(path, *log)
    assert {s.source for s in samples} == {"vehicle_gps_position"}
    assert reader.report().ignored == 1


def test_no_fix_an_old_fix_and_no_place(path: Path) -> None:
    log = [
        ulog.gps(START, 1, fix=1), ulog.gps(START + 1, 7), ulog.gps(START + 2, 7), ulog.gps(START + 3, 8, lat=NAN),
    ]  # fmt: skip
    samples, reader = read(path, ulog.header(), ulog.definitions(), *log)
    assert [type(s.reading) for s in samples] == [GeodeticPosition, Velocity, Velocity]
    assert reader.report().unusable == {
        "vehicle_gps_position.fix_type": 1,
        "vehicle_gps_position.time_utc_usec": 1,
    }
    assert reader.report().malformed == {"vehicle_gps_position.latitude": 1}


def test_a_barometer_is_in_pascal_or_as_it_was_before_in_millibar(path: Path) -> None:
    log = [
        ulog.data("sensor_baro", START, 95_000.0, 20.0),
        ulog.data("sensor_baro", START + 1, 950.0, NAN),
        ulog.data("sensor_baro", START + 2, NAN, 20.0),
    ]
    samples, reader = read(path, ulog.header(), ulog.definitions(), *log)
    assert [s.reading for s in samples] == [Pressure(95_000.0, None, 293.15), Pressure(95_000.0)]
    assert reader.report().malformed == {"sensor_baro.pressure": 1}


def test_the_other_sensors(path: Path) -> None:
    half = math.sqrt(0.5)
    log = [
        ulog.data("vehicle_attitude", START, half, 0.0, 0.0, half),
        ulog.data("vehicle_air_data", START + 1, 95_000.0, 20.0),
        ulog.data("vehicle_magnetometer", START + 2, 0.25, 0.0, 0.5),
        ulog.data("distance_sensor", START + 3, 2.5, 0.25, 40.0, 0.0625, -1, 25),
        ulog.data("wheel_encoders", START + 4, 1.5, 2.5, 0.0, 0.0),
        ulog.data("ranging_beacon", START + 5, 9, 12.5, 47.5, 8.5, 400.0, 0.5),
        ulog.data("ranging_beacon", START + 6, 9, 13.5, NAN, NAN, NAN, NAN),
        ulog.data("rpm", START + 7, 60.0),
        ulog.data("vehicle_local_position", START + 8, 47.5, 8.5, 400.0, True),
        ulog.data("vehicle_local_position", START + 9, 47.5, 8.5, 400.0, True),
    ]
    attitude, *rest = readings(path, *log)
    assert isinstance(attitude, Attitude)
    assert (attitude.roll, attitude.pitch, attitude.yaw) == pytest.approx((0.0, 0.0, math.pi / 2))
    assert rest == [
        Pressure(95_000.0, None, 293.15),
        Inertial(magnetic_field=(2.5e-5, 0.0, 5e-5)),
        Clearance(2.5, 25, 0.25),
        MotorSpeed(0, 1.5),
        MotorSpeed(1, 2.5),
        Range(9, 12.5, 0.5, math.radians(47.5), math.radians(8.5), 400.0),
        Range(9, 13.5),
        MotorSpeed(0, math.tau),
        Origin(math.radians(47.5), math.radians(8.5), 400.0),
    ]


def test_what_says_nothing_usable_is_counted(path: Path) -> None:
    log = [
        ulog.data("distance_sensor", START, 40.0, 0.25, 40.0, 0.0, -1, 25),
        ulog.data("distance_sensor", START + 1, 4.0, 0.25, 40.0, 0.0, 0, 25),
        ulog.data("ranging_beacon", START + 2, 9, 0.0, NAN, NAN, NAN, NAN),
        ulog.data("vehicle_attitude", START + 3, 0.0, 0.0, 0.0, 0.0),
        ulog.combined(START + 4, NAN, 0.0, 0.0),
    ]
    samples, reader = read(path, ulog.header(), ulog.definitions(), *log)
    assert [s.reading for s in samples] == [Inertial(None, (1.0, 2.0, -9.5))]
    assert sum(reader.report().unusable.values()) == 3
    assert reader.report().malformed == {"vehicle_attitude.q": 1, "sensor_combined.gyro_rad": 1}


def test_formats_inside_formats_and_a_second_instance(path: Path) -> None:
    """A nested array before the fields that are wanted; of two instances the first is used."""
    log = [
        ulog.message("F", b"inner:uint16_t a;uint8_t[2] b;"),
        ulog.message("F", b"rpm:uint64_t timestamp;inner[2] c;float rpm_estimate;uint8_t[3] _padding0;"),
        ulog.subscription("rpm", 0, 100),
        ulog.subscription("rpm", 1, 101),
        ulog.message("D", struct.pack("<HQHBBHBBf", 100, START, 1, 2, 3, 4, 5, 6, 60.0)),
        ulog.message("D", struct.pack("<HQHBBHBBf3x", 100, START, 1, 2, 3, 4, 5, 6, 120.0)),
        ulog.message("D", struct.pack("<HQHBBHBBf", 101, START, 1, 2, 3, 4, 5, 6, 60.0)),
    ]
    samples, reader = read(path, ulog.header(), ulog.flags(), *log)
    assert [s.reading for s in samples] == [MotorSpeed(0, math.tau), MotorSpeed(0, 2 * math.tau)]
    assert reader.report().ignored == 1


def test_formats_that_would_fill_the_memory_are_refused(path: Path) -> None:
    log = [ulog.message("F", f"f{i}:f{i + 1}[99] x;".encode()) for i in range(9)]
    log += [
        ulog.message("F", b"f9:uint8_t x;"),
        ulog.message("F", b"g:g x;"),
        ulog.message("F", b"no format"),
    ]
    log += [ulog.message("A", b"\0\0\0" + name) for name in (b"f0", b"g", b"h")]
    _, reader = read(path, ulog.header(), *log)
    assert reader.report().malformed == {"bad_format": 4}


def test_what_px4_could_not_write_is_said(path: Path) -> None:
    dropout = ulog.message("O", struct.pack("<H", 250))
    _, reader = read(path, ulog.header(), ulog.definitions(), ulog.combined(START), dropout, dropout)
    assert reader.report().malformed == {"dropout": 2, "dropout_ms": 500}


def test_data_that_were_appended(path: Path) -> None:
    """After a crash PX4 appends what was saved, though the last message before was cut off."""
    before = ulog.header() + ulog.flags(1, 0)
    definitions = ulog.definitions("sensor_combined")[len(ulog.flags()) :]
    cut = ulog.combined(START)[:-7]
    offset = len(before) + len(definitions) + len(cut)
    log = (
        ulog.header()
        + ulog.flags(1, offset)
        + definitions
        + cut
        + ulog.combined(START + 1)
        + ulog.combined(START + 2)
    )
    samples, reader = read(path, log)
    assert [s.received for s in samples] == [(START + 1) * 1_000, (START + 2) * 1_000]
    assert reader.report().malformed == {"bad_header": 1, "lost_bytes": len(cut)}


def test_a_hole_costs_what_it_covers(path: Path) -> None:
    entries = [ulog.combined(START + 5_000 * i) for i in range(20)]
    head = ulog.header() + ulog.definitions()
    size = len(entries[0])
    whole = bytearray(head + b"".join(entries))
    whole[len(head) + 5 * size + 10 : len(head) + 7 * size + 5] = b"D" * (2 * size - 5)
    samples, reader = read(path, bytes(whole))
    assert len(samples) == 20 - 3
    assert reader.report().malformed == {"bad_header": 1, "lost_bytes": 3 * size}


def mixed(count: int = 60) -> bytes:
    parts = [ulog.header(), ulog.definitions(), ulog.message("I", b"\x0cchar[3] nameabc")]
    for i in range(count):
        at = START + 20_000 * i
        parts += [ulog.combined(at), ulog.gps(at + 1, 1_700_000_000_000_001 + at, lat=47.0 + 1e-4 * i)]
        parts.append(ulog.data("vehicle_attitude", at + 2, 1.0, 0.0, 0.0, 0.0))
        parts += [ulog.SYNC] * (i % 10 == 0)
    return b"".join(parts)


def test_pyulog_reads_the_same(path: Path) -> None:
    samples, _ = read(path, mixed())
    theirs = ULog(io.BytesIO(mixed()))
    combined = theirs.get_dataset("sensor_combined").data
    mine = [s for s in samples if s.source == "sensor_combined"]
    assert len(mine) == 60
    np.testing.assert_array_equal([s.reading.angular_velocity[1] for s in mine], combined["gyro_rad[1]"])
    utc = 1_700_000_000_000_000
    np.testing.assert_array_equal([s.received // 1_000 - utc for s in mine], combined["timestamp"])
    fixes = [s.reading for s in samples if isinstance(s.reading, GeodeticPosition)]
    np.testing.assert_allclose(
        np.degrees([fix.latitude for fix in fixes]),
        theirs.get_dataset("vehicle_gps_position").data["latitude_deg"],
        rtol=1e-15,
    )


WHOLE = mixed()
HEAD = len(ulog.header() + ulog.definitions()) + 600


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.sampled_from(["truncated", "flipped", "inserted"]),
    st.integers(0, len(WHOLE)),
    st.binary(min_size=1, max_size=60),
)
def test_damage_costs_what_it_covers(path: Path, kind: str, at: int, noise: bytes) -> None:
    """After the definitions, at most the messages that were hit and the one before are lost, of 240 samples."""
    rest = {"truncated": b"", "flipped": noise + WHOLE[at + len(noise) :], "inserted": noise + WHOLE[at:]}[
        kind
    ]
    samples, reader = read(path, WHOLE[:at] + rest)
    assert all(a.received <= b.received for a, b in pairwise(samples))
    assert reader.position == reader.size
    if kind != "truncated" and at > HEAD:
        assert 240 - 15 <= len(samples) <= 241


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=3_000))
def test_any_bytes_are_survived(path: Path, log: bytes) -> None:
    for start in (b"", ulog.header(), ulog.header() + ulog.definitions()):
        _, reader = read(path, start + log)
        assert reader.position == reader.size
