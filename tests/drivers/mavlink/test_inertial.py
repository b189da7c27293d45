from __future__ import annotations

import math

import pytest

from drivers.sample import Attitude, Inertial, Pressure, Rotation
from tests.drivers.mavlink.conftest import SECOND, Ear
from tests.drivers.mavlink.wire import attitude, frame, heartbeat

ALL = 8191
FIELD = (0.2, 0.08, -0.5)  # gauss


def highres(updated: int, mag: tuple[float, float, float] = FIELD, acc: float = -9.8, unit: int = 0) -> bytes:
    return frame(
        "HIGHRES_IMU",
        *(7_000_000, 0.1, 0.2, acc, 0.01, 0.02, 0.03, *mag),
        *(1013.25, 0.5, 100.0, 25.0, updated, unit),
    )


def thousandths(name: str, stamp: int, *counts: int) -> bytes:
    tail = (0, 0) if name == "RAW_IMU" else (0,)
    return frame(name, stamp, *counts, *tail)


def test_highres_is_si_but_for_gauss_and_hectopascal(ear: Ear) -> None:
    inertial, pressure = (s.reading for s in ear.hear(highres(ALL)))
    assert isinstance(inertial, Inertial)
    assert inertial.specific_force == pytest.approx((0.1, 0.2, -9.8))
    assert inertial.angular_velocity == pytest.approx((0.01, 0.02, 0.03))
    assert inertial.magnetic_field == pytest.approx((0.2e-4, 0.08e-4, -0.5e-4))
    assert isinstance(pressure, Pressure)
    assert pressure.absolute == pytest.approx(101_325.0)
    assert pressure.temperature == pytest.approx(298.15)


def test_highres_says_only_what_was_updated(ear: Ear) -> None:
    (gyro,) = ear.hear(highres(8 | 16 | 32))
    assert gyro.reading == Inertial(angular_velocity=pytest.approx((0.01, 0.02, 0.03)))
    (yaw,) = ear.hear(highres(32))
    assert yaw.reading == Rotation(pytest.approx(0.03))
    (pressure,) = ear.hear(highres(512))
    assert pressure.reading == Pressure(pytest.approx(101_325.0))
    assert ear.hear(highres(0)) == []
    assert ear.refused == {}


def test_ardupilots_magnetometer_is_refused_and_the_rest_is_used(ear: Ear) -> None:
    """HIGHRES_IMU of a real ArduPilot: 224,015 "gauss"."""
    inertial, _ = ear.hear(highres(ALL, mag=(224_015.5, 80_639.2, -528_911.7)))
    assert isinstance(inertial.reading, Inertial)
    assert inertial.reading.magnetic_field is None
    assert inertial.reading.specific_force is not None
    assert ear.refused == {"HIGHRES_IMU.mag": 1}


@pytest.mark.parametrize("wrong", [math.nan, math.inf, 1e6])
def test_a_force_that_cannot_be_is_none(ear: Ear, wrong: float) -> None:
    inertial, _ = ear.hear(highres(ALL, acc=wrong))
    assert isinstance(inertial.reading, Inertial)
    assert inertial.reading.specific_force is None
    assert ear.refused == {"HIGHRES_IMU.acc": 1}


@pytest.mark.parametrize(
    ("name", "stamp"),
    [("RAW_IMU", 8_000_000), ("SCALED_IMU", 8_000), ("SCALED_IMU2", 8_000), ("SCALED_IMU3", 8_000)],
)
def test_thousandths_are_scaled(ear: Ear, name: str, stamp: int) -> None:
    (sample,) = ear.hear(thousandths(name, stamp, 100, -200, -1000, 10, -20, 30, 224, 80, -528))
    reading = sample.reading
    assert sample.source == name
    assert isinstance(reading, Inertial)
    assert reading.specific_force == pytest.approx((0.980665, -1.96133, -9.80665))
    assert reading.angular_velocity == pytest.approx((0.010, -0.020, 0.030))
    assert reading.magnetic_field == pytest.approx((22.4e-6, 8.0e-6, -52.8e-6))


def test_absent_units_are_none_and_a_gyro_at_rest_is_zero(ear: Ear) -> None:
    (sample,) = ear.hear(thousandths("RAW_IMU", 8_000_000, 0, 0, -1000, 0, 0, 0, 0, 0, 0))
    assert sample.reading == Inertial((0.0, 0.0, 0.0), pytest.approx((0.0, 0.0, -9.80665)), None)
    (sample,) = ear.hear(thousandths("SCALED_IMU3", 8_000, 0, 0, 0, 0, 0, 0, 224, 80, -528))
    assert isinstance(sample.reading, Inertial)
    assert sample.reading.angular_velocity is None
    assert sample.reading.specific_force is None
    assert ear.hear(thousandths("SCALED_IMU", 8_000, *[0] * 9)) == []


@pytest.mark.parametrize("count", [32_767, -32_768])
def test_a_saturated_count_is_refused(ear: Ear, count: int) -> None:
    (sample,) = ear.hear(thousandths("RAW_IMU", 8_000_000, 0, count, -1000, 1, 2, 3, 0, 0, 0))
    assert isinstance(sample.reading, Inertial)
    assert sample.reading.specific_force is None
    assert ear.refused == {"RAW_IMU.acc": 1}


def test_raw_imu_of_another_autopilot_is_counts_of_unknown_scale(ear: Ear) -> None:
    ear.hear(heartbeat(autopilot=12))  # PX4
    assert ear.hear(thousandths("RAW_IMU", 8_000_000, 1, 2, 3, 4, 5, 6, 7, 8, 9)) == []
    assert ear.passed_over == {"RAW_IMU.autopilot": 1}
    assert ear.refused == {}
    assert len(ear.hear(thousandths("SCALED_IMU", 8_000, 1, 2, 3, 4, 5, 6, 7, 8, 9))) == 1


def test_attitude(ear: Ear) -> None:
    (sample,) = ear.hear(attitude(9_000, yaw=3.0))
    assert sample.reading == Attitude(
        pytest.approx(0.1), pytest.approx(-0.2), pytest.approx(3.0), pytest.approx((0.01, 0.02, 0.03))
    )


def test_an_attitude_that_is_no_number_is_refused(ear: Ear) -> None:
    assert ear.hear(attitude(9_000, yaw=math.nan)) == []
    assert ear.refused == {"ATTITUDE.yaw": 1}


def test_stamps_of_one_autopilot_share_its_boot_clock(ear: Ear) -> None:
    """Milliseconds and microseconds since boot: the quick message tells how late the slow one was."""
    ear.hear(attitude(10_000), at=200 * SECOND)
    (late,) = ear.hear(thousandths("RAW_IMU", 10_020_000, 0, 0, -1000, 0, 0, 1, 0, 0, 0), at=200_300_000_000)
    assert late.time == pytest.approx(200_020_000_000, abs=50_000)
    assert late.received == 200_300_000_000


def test_a_second_unit_in_one_message_kind_is_not_counted_twice(ear: Ear) -> None:
    assert ear.hear(highres(ALL, unit=1)) == []
    assert ear.hear(frame("RAW_IMU", 8_000_000, 1, 2, 3, 4, 5, 6, 7, 8, 9, 1, 0)) == []
    assert ear.passed_over == {"HIGHRES_IMU.id": 1, "RAW_IMU.id": 1}
    assert ear.refused == {}
