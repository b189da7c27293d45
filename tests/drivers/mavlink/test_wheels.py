from __future__ import annotations

import math

import pytest

from drivers.sample import MotorSpeed, Odometer, Sample
from tests.drivers.mavlink.conftest import Ear
from tests.drivers.mavlink.wire import frame, wheels

MILLION = 1_000_000


def only(samples: list[Sample]) -> Odometer:
    (sample,) = samples
    assert isinstance(sample.reading, Odometer)
    return sample.reading


def test_totals_of_as_many_wheels_as_there_are(ear: Ear) -> None:
    assert only(ear.hear(wheels(MILLION, 1.25, -0.5))) == Odometer((1.25, -0.5), 0)
    assert only(ear.hear(wheels(2 * MILLION, 2.25, 0.5))) == Odometer((2.25, 0.5), 0)


def test_driving_backwards_is_the_same_epoch(ear: Ear) -> None:
    ear.hear(wheels(MILLION, 5.0))
    assert only(ear.hear(wheels(2 * MILLION, 4.0))).epoch == 0


def test_a_reboot_starts_an_epoch(ear: Ear) -> None:
    """The stamp falls back even where the distance hardly does."""
    ear.hear(wheels(100 * MILLION, 0.3, 0.3))
    assert only(ear.hear(wheels(2 * MILLION, 0.0, 0.0))) == Odometer((0.0, 0.0), 1)


def test_a_counter_that_jumps_starts_an_epoch(ear: Ear) -> None:
    ear.hear(wheels(100 * MILLION, 800.0))
    assert only(ear.hear(wheels(101 * MILLION, 0.0))).epoch == 1
    assert only(ear.hear(wheels(102 * MILLION, 50.0))).epoch == 1  # fast, but a wheel can


def test_a_wheel_more_starts_an_epoch(ear: Ear) -> None:
    ear.hear(wheels(MILLION, 1.0))
    assert only(ear.hear(wheels(2 * MILLION, 1.0, 1.0))).epoch == 1


def test_overtaken_messages_are_passed_over(ear: Ear) -> None:
    ear.hear(wheels(10 * MILLION, 1.0))
    assert ear.hear(wheels(10 * MILLION, 1.1)) == []
    assert ear.hear(wheels(10 * MILLION - 40_000, 0.9)) == []
    assert ear.passed_over == {"WHEEL_DISTANCE.time_usec": 2}
    assert ear.refused == {}


def test_a_repeated_message_says_that_nothing_has_rolled(ear: Ear) -> None:
    """An encoder that stamps its last edge stamps nothing new while the vehicle stands."""
    ear.hear(wheels(10 * MILLION, 1.0))
    (sample,) = ear.hear(wheels(10 * MILLION, 1.0))
    assert sample.reading == Odometer((1.0,), 0)
    assert sample.time == sample.received
    assert ear.refused == ear.passed_over == {}


def test_a_controller_without_a_clock(ear: Ear) -> None:
    ear.hear(wheels(0, 1.0))
    assert only(ear.hear(wheels(0, 1.1))) == Odometer((1.1,), 0)
    assert only(ear.hear(wheels(0, 900.0))).epoch == 1


@pytest.mark.parametrize("count", [0, 17, 255])
def test_an_impossible_count_is_refused(ear: Ear, count: int) -> None:
    assert ear.hear(wheels(MILLION, 1.0, count=count)) == []
    assert ear.refused == {"WHEEL_DISTANCE.count": 1}


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
def test_a_distance_that_is_no_number_is_refused(ear: Ear, wrong: float) -> None:
    assert ear.hear(wheels(MILLION, 1.0, wrong)) == []
    assert ear.refused == {"WHEEL_DISTANCE.distance": 1}
    assert only(ear.hear(wheels(2 * MILLION, 1.0, 2.0))).epoch == 0


def test_revolutions_a_minute(ear: Ear) -> None:
    first, second = ear.hear(frame("RPM", 60.0, 1_500.0))
    assert first.reading == MotorSpeed(0, pytest.approx(2 * math.pi))
    assert second.reading == MotorSpeed(1, pytest.approx(50 * math.pi))


def test_a_sensor_that_does_not_exist_says_minus_one(ear: Ear) -> None:
    (only_first,) = ear.hear(frame("RPM", 60.0, -1.0))
    assert only_first.reading == MotorSpeed(0, pytest.approx(2 * math.pi))
    assert ear.refused == {}


def test_zero_is_believed_of_a_sensor_that_has_turned(ear: Ear) -> None:
    assert ear.hear(frame("RPM", 0.0, -1.0)) == []
    assert ear.passed_over == {"RPM.rpm1": 1}
    assert ear.refused == {}
    ear.hear(frame("RPM", 60.0, -1.0))
    (still,) = ear.hear(frame("RPM", 0.0, -1.0))
    assert still.reading == MotorSpeed(0, 0.0)


def test_revolutions_that_are_no_number_are_refused(ear: Ear) -> None:
    assert ear.hear(frame("RPM", math.nan, math.inf)) == []
    assert ear.refused == {"RPM.rpm1": 1, "RPM.rpm2": 1}
