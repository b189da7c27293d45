from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from drivers.mavlink.control import deflection
from drivers.mavlink.settings import ServoCalibration
from drivers.sample import ActuatorCommand, MotionCommand, Presence
from tests.drivers.mavlink.conftest import SECOND, Ear
from tests.drivers.mavlink.wire import attitude, frame, heartbeat

POSITION, HORIZONTAL, DOWN, ACCELERATION, YAW, YAW_RATE = 7, 24, 32, 448, 1024, 2048


def target(mask: int, frame_id: int = 1, vx: float = 1.0, yaw_rate: float = 0.25) -> bytes:
    return frame(
        "POSITION_TARGET_LOCAL_NED",
        *(7_000, 0.0, 0.0, 0.0, vx, 2.0, 3.0, 0.0, 0.0, 0.0, 0.5, yaw_rate, mask, frame_id),
    )


def servo_output(stamp: int, port: int, *pulses: int) -> bytes:
    outputs = (*pulses, *[0] * (16 - len(pulses)))
    return frame("SERVO_OUTPUT_RAW", stamp, *outputs[:8], port, *outputs[8:])


def test_velocity_and_yaw_rate(ear: Ear) -> None:
    (sample,) = ear.hear(target(POSITION | ACCELERATION | YAW))
    assert sample.reading == MotionCommand((1.0, 2.0, 3.0), 0.25, body=False)


@pytest.mark.parametrize(("frame_id", "body"), [(1, False), (7, False), (8, True), (9, True), (12, True)])
def test_frames(ear: Ear, frame_id: int, body: bool) -> None:
    (sample,) = ear.hear(target(0, frame_id))
    assert isinstance(sample.reading, MotionCommand)
    assert sample.reading.body is body


def test_a_frame_that_is_neither_is_passed_over(ear: Ear) -> None:
    assert ear.hear(target(0, frame_id=0)) == []
    assert ear.passed_over == {"POSITION_TARGET_LOCAL_NED.coordinate_frame": 1}
    assert ear.refused == {}


def test_what_the_mask_ignores_is_none(ear: Ear) -> None:
    (only_rate,) = ear.hear(target(HORIZONTAL))
    assert only_rate.reading == MotionCommand(None, 0.25)
    (only_velocity,) = ear.hear(target(YAW_RATE))
    assert only_velocity.reading == MotionCommand((1.0, 2.0, 3.0), None)
    (level,) = ear.hear(target(DOWN | YAW_RATE))
    assert level.reading == MotionCommand((1.0, 2.0, 0.0), None)
    assert ear.hear(target(HORIZONTAL | YAW_RATE)) == []
    assert ear.refused == {}


def test_px4_marks_what_it_does_not_command_by_nan(ear: Ear) -> None:
    (sample,) = ear.hear(target(0, vx=math.nan))
    assert sample.reading == MotionCommand(None, 0.25)
    assert ear.hear(target(0, vx=math.nan, yaw_rate=math.nan)) == []


SERVO = ServoCalibration(1, 1000, 1400, 2000)


@pytest.mark.parametrize(
    ("pulse", "value"),
    [(1400, 0.0), (2000, 1.0), (1000, -1.0), (1700, 0.5), (1200, -0.5), (2200, 1.0), (900, -1.0)],
)
def test_a_pulse_about_its_trim(pulse: int, value: float) -> None:
    assert deflection(pulse, SERVO) == pytest.approx(value)
    assert deflection(pulse, ServoCalibration(1, 1000, 1400, 2000, reversed=True)) == pytest.approx(-value)


@pytest.mark.parametrize("pulse", [0, 0xFFFF])
def test_no_pulse_is_none(pulse: int) -> None:
    assert deflection(pulse, SERVO) is None


def test_a_one_sided_throttle() -> None:
    throttle = ServoCalibration(3, 1000, 1000, 2000)
    assert deflection(1000, throttle) == 0.0
    assert deflection(1500, throttle) == pytest.approx(0.5)
    assert deflection(950, throttle) == 0.0


def test_channels_by_number(listen: Callable[..., Ear]) -> None:
    ear = listen(servos=(ServoCalibration(1), ServoCalibration(3), ServoCalibration(18)))
    (low,) = ear.hear(servo_output(1_000, 0, 1900, 1300, 0))
    assert low.reading == ActuatorCommand((1.0, None, None))
    (high,) = ear.hear(servo_output(1_000, 1, 1500, 1100))
    assert high.reading == ActuatorCommand((*[None] * 17, -1.0))


def test_servos_without_a_calibration_are_not_used(ear: Ear) -> None:
    assert ear.hear(servo_output(1_000, 0, 1900)) == []
    assert ear.refused == {}


def test_the_stamp_of_servos_wraps_after_71_minutes(listen: Callable[..., Ear]) -> None:
    """Booted 80 minutes ago: 4,800 s are 505.03 s in the second turn of a 32-bit counter."""
    ear = listen(servos=(ServoCalibration(1),))
    ear.hear(attitude(4_800_000), at=9_000 * SECOND)
    stamp = (4_800 * 1_000_000 + 20_000) % 2**32
    (sample,) = ear.hear(servo_output(stamp, 0, 1500), at=9_000 * SECOND + 100_000_000)
    assert sample.time == pytest.approx(9_000 * SECOND + 20_000_000, abs=50_000)


@pytest.mark.parametrize(
    ("settings", "complaint"),
    [
        ((0,), "channel 0"),
        ((33,), "channel 33"),
        ((1, 1900, 1500, 1100), "minimum"),
        ((1, 1100, 2000, 1900), "trim"),
    ],
)
def test_a_wrong_calibration_says_so(settings: tuple[int, ...], complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        ServoCalibration(*settings)  # type: ignore[arg-type]


def test_presence(ear: Ear) -> None:
    (sample,) = ear.hear(heartbeat(armed=True))
    assert sample.reading == Presence(10, 3, armed=True, system_status=4)
