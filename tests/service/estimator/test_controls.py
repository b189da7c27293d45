"""Controls as totals over time: interpolated, held for a while, honest about gaps; one speaker at a time."""

from __future__ import annotations

import math

import pytest

from drivers.sample import (
    SECOND,
    ActuatorCommand,
    AnyReading,
    Attitude,
    Inertial,
    MotionCommand,
    MotorSpeed,
    Odometer,
    Pressure,
    Rotation,
    Sample,
    Speed,
)
from service.estimator.controls import SILENCE, Controls, Throttle

MS = 1_000_000


def sample(time: int, reading: AnyReading, source: str = "S", link: str = "l") -> Sample:
    return Sample(time, time, link, source, reading)


def imu(time: int, rate: float, source: str = "HIGHRES_IMU") -> Sample:
    return sample(time, Inertial(angular_velocity=(0.0, 0.0, rate)), source)


def test_time_running_backwards_is_refused_and_counted() -> None:
    controls = Controls()
    controls.take(imu(2 * SECOND, 0.1))
    controls.take(imu(SECOND, 0.1))
    assert controls.out_of_order == 1


def test_three_messages_about_one_gyro_count_once() -> None:
    controls = Controls()
    for k in range(100):
        time = k * 10 * MS
        controls.take(imu(time, 0.5, "RAW_IMU"))
        controls.take(imu(time + 1, 0.5, "HIGHRES_IMU"))
        controls.take(imu(time + 2, 0.5, "SCALED_IMU2"))
        controls.take(sample(time + 3, Attitude(0, 0, 0, (0, 0, 0.5)), "ATTITUDE"))
    assert controls.sources[1] == "HIGHRES_IMU"
    assert controls.turn(0, 990 * MS).total == pytest.approx(0.495, rel=0.02)


def test_the_next_speaker_takes_over_after_a_silence_and_gives_back() -> None:
    controls = Controls()
    controls.take(imu(0, 0.1, "HIGHRES_IMU"))
    controls.take(imu(SILENCE // 2, 0.2, "RAW_IMU"))
    assert controls.sources[1] == "HIGHRES_IMU"
    controls.take(imu(2 * SILENCE, 0.2, "RAW_IMU"))
    assert controls.sources[1] == "RAW_IMU"
    controls.take(imu(2 * SILENCE + MS, 0.1, "HIGHRES_IMU"))
    assert controls.sources[1] == "HIGHRES_IMU"


def test_a_configured_source_is_the_only_one_heard() -> None:
    controls = Controls(yaw_rate_from="RAW_IMU")
    controls.take(imu(0, 9.0, "HIGHRES_IMU"))
    assert controls.sources[1] is None
    controls.take(imu(1, 0.1, "RAW_IMU"))
    assert controls.sources[1] == "RAW_IMU"


def test_two_wheels_and_a_track_make_a_yaw_rate() -> None:
    """Left 0.5 m/s faster than right over a track of 0.5 m: one rad/s, clockwise."""
    controls = Controls(wheel_track=0.5)
    for k in range(21):
        t = k * 50 * MS
        controls.take(sample(t, Odometer((1.5 * t / SECOND, 1.0 * t / SECOND)), "WHEEL_DISTANCE"))
    assert controls.turn(100 * MS, 900 * MS).total == pytest.approx(0.8)
    assert controls.distance(100 * MS, 900 * MS).total == pytest.approx(1.0)


def test_motors_need_a_wheel_radius() -> None:
    without, with_radius = Controls(), Controls(wheel_radius=0.1)
    for controls in (without, with_radius):
        for k in range(11):
            controls.take(sample(k * 100 * MS, MotorSpeed(0, 20.0), "esc.Status"))
    assert without.sources[0] is None
    assert with_radius.distance(0, SECOND).total == pytest.approx(2.0)


def test_commands_speak_only_when_nothing_measures() -> None:
    controls = Controls()
    for k in range(20):
        controls.take(
            sample(
                k * 100 * MS,
                MotionCommand(velocity=(3.0, 4.0, 0.0), yaw_rate=0.1),
                "POSITION_TARGET_LOCAL_NED",
            )
        )
    assert controls.speed(SECOND) == pytest.approx(5.0)
    assert controls.yaw_rate(SECOND) == pytest.approx(0.1)
    controls.take(sample(2 * SECOND, Speed(1.0), "sample/dvl"))
    controls.take(sample(2 * SECOND, Rotation(0.2), "sample/gyro"))
    assert controls.sources == ("sample/dvl", "sample/gyro")


def test_an_actuator_speaks_last_and_only_when_it_is_named() -> None:
    command = ActuatorCommand((0.0, None, 0.5))
    unnamed, named = Controls(), Controls(throttle=Throttle(3, 4.0))
    for controls in (unnamed, named):
        for k in range(11):
            controls.take(sample(k * 100 * MS, command, "SERVO_OUTPUT_RAW"))
    assert unnamed.sources[0] is None
    assert named.distance(0, SECOND).total == pytest.approx(2.0)
    named.take(sample(SECOND, Odometer((0.0,)), "WHEEL_DISTANCE"))
    assert named.sources[0] == "WHEEL_DISTANCE"


def test_two_motors_of_one_message_are_averaged_at_its_time() -> None:
    """RPM has two sensors and one stamp: the second is no sample out of order."""
    controls = Controls(wheel_radius=0.1)
    for k in range(11):
        for index, speed in ((0, 10.0 + k), (1, 30.0 + k)):
            controls.take(sample(k * 100 * MS, MotorSpeed(index, speed), "RPM"))
    assert controls.out_of_order == 0
    assert controls.distance(100 * MS, SECOND).total == pytest.approx(0.9 * 0.1 * (20.0 + 5.5), rel=0.02)


def test_a_motor_that_fell_silent_or_is_anothers_has_no_say() -> None:
    controls = Controls(wheel_radius=0.1)
    controls.take(sample(0, MotorSpeed(1, 1000.0), "esc.Status"))
    for k in range(11):
        time = 2 * SECOND + k * 100 * MS
        controls.take(sample(time, MotorSpeed(0, 20.0), "esc.Status"))
        controls.take(sample(time + 1, MotorSpeed(2, 500.0), "sample/motor"))
    assert controls.distance(2 * SECOND, 3 * SECOND).total == pytest.approx(2.0)


@pytest.mark.parametrize("broken", [math.nan, math.inf, -1e200, 1e9])
def test_a_broken_number_is_counted_and_leaves_the_totals_alone(broken: float) -> None:
    controls = Controls(wheel_radius=0.1)
    for k in range(21):
        at = k * 50 * MS
        if k == 10:
            controls.take(sample(at, Odometer((broken,))))
            controls.take(imu(at, broken))
            controls.take(sample(at, MotorSpeed(0, broken)))
        else:
            controls.take(sample(at, Odometer((0.05 * k,))))
            controls.take(imu(at, 0.5))
    assert controls.implausible == 4  # to the broken total and back from it, a rate, a motor
    assert controls.turn(0, SECOND)[:2] == pytest.approx((0.5, 0.0))
    distance = controls.distance(0, SECOND)
    assert distance.total == pytest.approx(0.9)
    assert distance.unknown == pytest.approx(0.1)


def test_an_odometer_without_wheels_is_none() -> None:
    controls = Controls()
    for k in range(2):
        controls.take(sample(k * SECOND, Odometer(())))
    assert controls.implausible == 2
    assert controls.sources[0] is None


def test_two_counters_make_no_turn_together() -> None:
    """Left less right is 0 m for the first counter and 5 m for the one that takes over: nothing has turned."""
    controls = Controls(wheel_track=0.5)
    for k in range(10):
        controls.take(sample(k * 50 * MS, Odometer((0.0, 0.0)), "b"))
    for k in range(10, 20):
        controls.take(sample(k * 50 * MS, Odometer((5.0, 0.0)), "a"))
    assert controls.sources[0] == "a"
    assert controls.turn(0, SECOND).total == 0.0


def test_what_is_no_control_is_left_to_others() -> None:
    assert not Controls().take(sample(0, Pressure(101325.0)))


def test_memory_is_bounded() -> None:
    controls = Controls()
    for k in range(20_000):
        controls.take(imu(k * 10 * MS, 0.01))
        controls.forget(k * 10 * MS - SECOND)
    turn = controls.turn(20_000 * 10 * MS - SECOND, 19_999 * 10 * MS)
    assert math.isclose(turn.total, 0.0099, rel_tol=0.02)
    assert len(controls._turn._times) < 400
