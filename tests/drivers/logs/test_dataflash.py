"""DataFlash logs: written by hand, read as pymavlink reads them, and damaged in every way."""

from __future__ import annotations

import math
import struct
from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pymavlink import DFReader

from drivers.logs import LogReader
from drivers.logs.dataflash import DataflashReader
from drivers.sample import (
    AnyReading,
    Attitude,
    Clearance,
    GeodeticPosition,
    Inertial,
    MotorSpeed,
    Odometer,
    Origin,
    Pressure,
    Range,
    Sample,
    Velocity,
)
from tests.drivers.logs import dataflash as df

KATWIJK = Path(__file__).parents[4] / "shared" / "data" / "bcn_katwijk1.bin"
BASE = 1_700_000_000  # any time since boot, µs


def read(path: Path, *parts: bytes) -> tuple[list[Sample], DataflashReader]:
    path.write_bytes(b"".join(parts))
    reader = DataflashReader(path, "autopilot")
    return list(reader), reader


def readings(path: Path, *parts: bytes) -> list[AnyReading]:
    return [sample.reading for sample in read(path, df.definitions(), *parts)[0]]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "flight.bin"


def test_samples_in_order_on_the_clock_since_boot(path: Path) -> None:
    samples, reader = read(path, df.definitions(), *(df.imu(BASE + 10_000 * i) for i in range(5)))
    assert [s.received for s in samples] == [(BASE + 10_000 * i) * 1_000 for i in range(5)]
    assert {(s.link, s.source) for s in samples} == {("autopilot", "IMU")}
    report = reader.report()
    assert (report.messages, report.samples, report.malformed, report.clock) == (5, 5, {}, "boot")
    assert reader.kinds() == {"FMT": len(df.KINDS), "IMU": 5}
    assert reader.position == reader.size == path.stat().st_size
    assert list(reader) == samples


def test_with_a_fix_the_clock_is_unix_time(path: Path) -> None:
    """Week 2300, 345,600 s: 2024-02-08 00:00:00 GPS time, 18 s ahead of UTC."""
    log = [df.imu(BASE), *(df.gps(BASE + 200_000 * (i + 1), 345_600_000 + 200 * i) for i in range(5))]
    samples, reader = read(path, df.definitions(), *log)
    assert samples[1].received == (1_707_350_400 - 18) * 1_000_000_000
    assert samples[0].received == samples[1].received - 200_000_000
    assert reader.report().clock == "gps"


def test_one_damaged_date_does_not_move_the_clock(path: Path) -> None:
    fixes = [df.gps(BASE + 200_000 * i, 345_600_000 + 200 * i, week=2300 + 40 * (i == 0)) for i in range(5)]
    samples, _ = read(path, df.definitions(), *fixes)
    assert samples[0].received == (1_707_350_400 - 18) * 1_000_000_000


def test_inertial_units_beyond_the_first_are_left_out(path: Path) -> None:
    samples, reader = read(path, df.definitions(), df.imu(BASE), df.imu(BASE + 10, unit=1))
    assert [s.reading for s in samples] == [
        Inertial(
            tuple(np.float32([0.1, 0.2, 0.3]).astype(float)), tuple(np.float32([1, 2, -9.8]).astype(float))
        )
    ]
    assert reader.report().ignored == 1


def test_an_unhealthy_gyro_is_not_used(path: Path) -> None:
    sick = df.message("IMU", BASE, 0, 1.0, 1.0, 1.0, 0.0, 0.0, -9.5, 0, 0, 40.0, 0, 1, 0, 0)
    broken = df.message("IMU", BASE + 1, 0, math.nan, 1.0, 1.0, 0.0, 0.0, -9.5, 0, 0, 40.0, 1, 1, 0, 0)
    samples, reader = read(path, df.definitions(), sick, broken)
    assert [s.reading for s in samples] == [Inertial(None, (0.0, 0.0, -9.5))] * 2
    assert reader.report().unusable == {"IMU.GH": 1}
    assert reader.report().malformed == {"IMU.Gyr": 1}


def test_a_fix_takes_its_accuracy_from_the_message_before_it(path: Path) -> None:
    accuracy = df.message("GPA", BASE, 0, 180, 90, 150, 30, 0.0, 1, 0, 200)
    position, velocity = readings(path, accuracy, df.gps(BASE + 1, 1_000))
    assert isinstance(position, GeodeticPosition)
    assert (math.degrees(position.latitude), math.degrees(position.longitude)) == pytest.approx(
        (52.1712489, 4.4104949), abs=1e-12
    )
    assert (position.altitude, position.satellites) == (pytest.approx(12.5), 9)
    assert (position.sigma_horizontal, position.sigma_vertical) == pytest.approx((0.9, 1.5))
    assert isinstance(velocity, Velocity)
    assert (velocity.north, velocity.east, velocity.down, velocity.sigma) == pytest.approx(
        (0.0, 2.0, -0.5, 0.3)
    )


def test_no_fix_an_old_fix_and_no_place(path: Path) -> None:
    samples, reader = read(
        path,
        df.definitions(),
        df.gps(BASE, 1_000, status=1),
        df.gps(BASE + 1, 1_000, status=2),
        df.gps(BASE + 2, 1_000),
        df.message("GPS", BASE + 3, 0, 3, 1_200, 2300, 9, 110, 0, 0, 0, 2.0, 90.0, 0.0, 0.0, 1),
        df.gps(BASE + 4, 1_200, unit=1),
    )
    assert [s.source for s in samples] == ["GPS", "GPS", "GPS2", "GPS2"]
    assert samples[0].reading.altitude is None
    assert reader.report().unusable == {"GPS.Status": 1, "GPS.GMS": 1}
    assert reader.report().malformed == {"GPS.Lat": 1}


def test_ranges_to_beacons_but_not_their_repetitions(path: Path) -> None:
    def bcn(at: int, count: int, *distances: float) -> bytes:
        return df.message("BCN", at, 1, count, *distances, 0.0, 0.0, 0.0)

    log = [
        bcn(BASE, 4, 1.5, 2.5, 0.0, 4.5),
        bcn(BASE + 1, 3, 1.5, 2.75, 3.0, 4.75),
        bcn(BASE + 2, 200, 9, 9, 9, 9),
    ]
    assert readings(path, *log)[:6] == [
        Range(0, 1.5), Range(1, 2.5), Range(3, 4.5), Range(1, 2.75), Range(2, 3.0), Range(0, 9.0),
    ]  # fmt: skip


def test_an_encoder_that_is_not_fitted_is_no_wheel(path: Path) -> None:
    wheels = [(0.0, 0, 0.0, 0), (1.0, 90, 0.0, 0), (2.0, 90, 0.0, 0), (3.0, 90, 0.5, 90)]
    log = [df.message("WENC", BASE + i, *values) for i, values in enumerate(wheels)]
    assert readings(path, *log) == [Odometer((1.0,), 0), Odometer((2.0,), 0), Odometer((3.0, 0.5), 1)]


def test_the_other_sensors(path: Path) -> None:
    log = [
        df.message("RFND", BASE, 0, 250, 4, 25, 100),
        df.message("RFND", BASE + 1, 1, 6_000, 3, 0, 0),
        df.message("MAG", BASE + 2, 0, 260, -1570, 4360, 1),
        df.message("MAG", BASE + 3, 0, 1, 2, 3, 0),
        df.message("BARO", BASE + 4, 0, 1.5, 98_765.0, 2_050, 0.0, 1),
        df.message("ATT", BASE + 5, 0, 1_000, 0, -2_000, 0, 27_000),
        df.message("ORGN", BASE + 6, 0, 521_712_489, 44_104_949, 1_250),
        df.message("ORGN", BASE + 7, 1, 1, 1, 1),
        df.message("POS", BASE + 8, 521_712_489, 44_104_949, 1.0, 1.0, 1.0),
        df.message("RPM", BASE + 9, 0.0, -1.0),
        df.message("RPM", BASE + 10, 60.0, -1.0),
    ]
    clearance, field, pressure, attitude, origin, motor = readings(path, *log)
    assert clearance == Clearance(2.5, 25)
    assert isinstance(field, Inertial)
    assert field.magnetic_field == pytest.approx((26e-6, -157e-6, 436e-6))
    assert isinstance(pressure, Pressure)
    assert (pressure.absolute, pressure.temperature) == pytest.approx((98_765.0, 293.65))
    assert isinstance(attitude, Attitude)
    assert (attitude.roll, attitude.pitch, attitude.yaw) == pytest.approx(
        (math.radians(10), math.radians(-20), math.radians(270))
    )
    assert isinstance(origin, Origin)
    assert (origin.latitude, origin.altitude) == pytest.approx((math.radians(52.1712489), 12.5), abs=1e-12)
    assert isinstance(motor, MotorSpeed)
    assert (motor.index, motor.angular_speed) == (0, pytest.approx(math.tau))


def test_two_range_finders_in_one_message_as_before_2019(path: Path) -> None:
    layout = df.message(
        "FMT", 145, 19, b"RFND", b"QCBBCBB", b"TimeUS,Dist1,Stat1,Orient1,Dist2,Stat2,Orient2"
    )
    log = b"\xa3\x95\x91" + struct.pack("<QHBBHBB", BASE, 250, 4, 25, 700, 3, 0)
    samples, reader = read(path, df.definitions("FMT"), layout, log)
    assert [s.reading for s in samples] == [Clearance(2.5, 25)]
    assert reader.report().unusable == {"RFND.Dist2": 1}


def test_what_says_that_it_is_sick_is_not_used(path: Path) -> None:
    log = [
        df.message("BARO", BASE, 0, 1.5, 98_765.0, 2_050, 0.0, 0),
        df.message("IMU", BASE + 1, 0, 0.5, 0.5, 0.5, 0.0, 0.0, 1e4, 0, 0, 40.0, 1, 1, 0, 0),
        df.message("IMU", BASE + 2, 0, 0.5, 0.5, 0.5, 0.0, 0.0, -9.5, 0, 0, 40.0, 1, 0, 0, 0),
        df.message("MAG", BASE + 3, 0, 30_000, 0, 0, 1),
    ]
    samples, reader = read(path, df.definitions(), *log)
    assert [s.reading for s in samples] == [Inertial((0.5, 0.5, 0.5))] * 2
    assert reader.report().unusable == {"BARO.Health": 1, "IMU.AH": 1}
    assert reader.report().malformed == {"IMU.Acc": 1, "MAG.Mag": 1}


LABELS = {"k": b"deg/s", "m": b"m", "G": b"Gauss", "E": b"rad/s"}
MULTIPLIERS = {"A": 0.1, "B": 0.01, "0": 1.0, "?": 1.0, "-": 0.0}
UNITS = [
    *(df.message("UNIT", 1, ord(i), label) for i, label in LABELS.items()),
    *(df.message("MULT", 2, ord(i), float(np.float32(value))) for i, value in MULTIPLIERS.items()),
]


def test_what_the_log_says_of_units_goes_first(path: Path) -> None:
    """A firmware that logs the gyro in degrees per second and the field in tenths of a gauss."""
    said = [
        df.message("FMTU", 3, 140, b"s#kkkooo--O--zz", b"F-000000-----00"),
        df.message("FMTU", 4, 146, b"s#GGG-", b"F-AAA-"),
    ]
    inertial, field = readings(
        path, *UNITS, *said, df.imu(BASE, 180.0, 90.0, 45.0), df.message("MAG", BASE + 1, 0, 3, 0, 4, 1)
    )
    assert isinstance(inertial, Inertial)
    assert inertial.angular_velocity == pytest.approx((math.pi, math.pi / 2, math.pi / 4))
    assert isinstance(field, Inertial)
    assert field.magnetic_field == pytest.approx((3e-5, 0.0, 4e-5), rel=1e-12)


def test_a_multiplier_of_a_floating_column_is_not_believed(path: Path) -> None:
    """ArduPilot 3.6 says that BCN's distances were centimetres; they are metres."""
    said = df.message("FMTU", 3, 143, b"s--mmmmmmm", b"F--BBBBBBB")
    log = df.message("BCN", BASE, 1, 1, 6.5, 0, 0, 0, 0.0, 0.0, 0.0)
    assert readings(path, *UNITS, said, log) == [Range(0, 6.5)]


def test_a_definition_that_cannot_be_true_is_refused(path: Path) -> None:
    wrong = [
        df.message("FMT", 140, 50, b"IMU", b"QB", b"TimeUS,I"),
        df.message("FMT", 140, 12, b"IMU", b"QB", b"TimeUS"),
        df.message("FMT", 140, 12, b"IMU", b"Q#", b"TimeUS,I"),
    ]
    samples, reader = read(path, df.definitions(), *wrong, df.imu(BASE))
    assert len(samples) == 1
    assert reader.report().malformed == {"bad_format": 3}


def test_a_column_that_a_firmware_does_not_log(path: Path) -> None:
    short = df.message("FMT", 146, 12, b"MAG", b"QB", b"TimeUS,I")
    samples, reader = read(path, df.definitions("FMT"), short, b"\xa3\x95\x92" + bytes(9))
    assert samples == []
    assert reader.report().malformed == {"MAG.MagX": 1}


def test_a_hole_costs_what_it_covers(path: Path) -> None:
    entries = [df.imu(BASE + 10_000 * i) for i in range(20)]
    whole = bytearray(df.definitions() + b"".join(entries))
    size = len(entries[0])
    first = len(df.definitions()) + 5 * size
    whole[first + 10 : first + 2 * size + 5] = b"\xa3" * (2 * size - 5)
    samples, reader = read(path, bytes(whole))
    assert len(samples) == 20 - 3
    assert reader.report().malformed == {"bad_header": 1, "lost_bytes": 3 * size}


def test_a_log_that_was_cut_off(path: Path) -> None:
    whole = df.definitions() + df.imu(BASE) + df.imu(BASE + 1)
    for length in range(len(whole) - 1, len(whole) - len(df.imu(BASE)), -1):
        samples, reader = read(path, whole[:length])
        assert len(samples) <= 1
        assert reader.report().malformed["bad_header"] == 1


def test_a_damaged_stamp_does_not_stop_the_clock(path: Path) -> None:
    stamps = [BASE + 10_000 * i for i in range(20)]
    stamps[7] = 2**63
    samples, reader = read(path, df.definitions(), *(df.imu(stamp) for stamp in stamps))
    assert [s.received for s in samples[8:]] == [stamp * 1_000 for stamp in stamps[8:]]
    assert all(a.received <= b.received for a, b in pairwise(samples))
    assert reader.report().malformed == {"bad_stamp": 1}


def test_an_empty_log_and_an_absent_one(path: Path) -> None:
    assert read(path)[0] == []
    with pytest.raises(FileNotFoundError):
        list(DataflashReader(path.with_name("absent.bin"), "autopilot"))


def mixed(count: int = 60) -> bytes:
    parts = [df.definitions(), *UNITS]
    for i in range(count):
        at = BASE + 20_000 * i
        parts += [df.imu(at), df.message("BCN", at + 1, 1, 2, 1.0 + i, 2.0 + i, 0, 0, 0.0, 0.0, 0.0)]
        parts.append(df.gps(at + 2, 1_000 + 20 * i))
    return b"".join(parts)


def test_pymavlink_reads_the_same(path: Path) -> None:
    samples, _ = read(path, mixed())
    log: Any = DFReader.DFReader_binary(str(path))
    theirs: Counter[str] = Counter()
    while (message := log.recv_match(type=["IMU", "BCN", "GPS"])) is not None:
        theirs[message.get_type()] += 1
        mine = [s.reading for s in samples if s.source == message.get_type()]
        if message.get_type() == "IMU":
            assert mine[theirs["IMU"] - 1].angular_velocity == (message.GyrX, message.GyrY, message.GyrZ)
        if message.get_type() == "GPS":
            assert mine[2 * (theirs["GPS"] - 1)].latitude == pytest.approx(
                math.radians(message.Lat), abs=1e-15
            )
        if message.get_type() == "BCN":
            assert mine[2 * (theirs["BCN"] - 1)].distance == message.D0
    assert theirs == {"IMU": 60, "BCN": 60, "GPS": 60}


WHOLE = mixed()


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.sampled_from(["truncated", "flipped", "inserted"]),
    st.integers(0, len(WHOLE)),
    st.binary(min_size=1, max_size=60),
)
def test_damage_costs_what_it_covers(path: Path, kind: str, at: int, noise: bytes) -> None:
    """After the definitions, at most the messages that were hit and the one before are lost, of 240."""
    rest = {"truncated": b"", "flipped": noise + WHOLE[at + len(noise) :], "inserted": noise + WHOLE[at:]}[
        kind
    ]
    samples, reader = read(path, WHOLE[:at] + rest)
    assert all(a.received <= b.received for a, b in pairwise(samples))
    assert reader.position == reader.size
    if kind != "truncated" and at > len(df.definitions()) + 800:
        assert 300 - 15 <= len(samples) <= 301


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=3_000))
def test_any_bytes_are_survived(path: Path, log: bytes) -> None:
    for start in (b"", df.definitions()):
        _, reader = read(path, start + log)
        assert reader.position == reader.size


@pytest.mark.recordings
@pytest.mark.skipif(not KATWIJK.exists(), reason=f"the recording {KATWIJK.name} is not in ../shared/data")
def test_a_real_flight_among_beacons() -> None:
    """ArduCopter 3.6.8 with Pozyx beacons: equal to what others parsed of it, to the last digit."""
    log: LogReader = DataflashReader(KATWIJK, "autopilot")
    samples = list(log)
    kinds = Counter(sample.source for sample in samples)
    assert kinds == {
        "BCN": 10_132,
        "IMU": 6_818,
        "MAG": 2_728,
        "BARO": 2_727,
        "ATT": 2_727,
        "ORGN": 1,
        "XKF0": 4,
    }
    assert log.report().malformed == {}
    parsed = np.load(KATWIJK.with_suffix(".npz"))
    imu = [s for s in samples if s.source == "IMU"]
    np.testing.assert_array_equal(
        [s.reading.angular_velocity + s.reading.specific_force for s in imu], parsed["IMU"][:, 1:]
    )
    np.testing.assert_allclose([s.time * 1e-9 for s in imu], parsed["IMU"][:, 0], rtol=0, atol=1e-9)
    ranges = {
        (s.reading.beacon, round(s.time * 1e-3)): s.reading.distance for s in samples if s.source == "BCN"
    }
    for row in parsed["BCN"][::100]:
        for beacon in range(4):
            said = ranges.get((beacon, round(row[0] * 1e6)))
            assert said is None or said == pytest.approx(row[3 + beacon], abs=1e-6)
