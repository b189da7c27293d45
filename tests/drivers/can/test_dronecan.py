"""Each message type from the dronecan package's encoder to a reading in SI units, and every way to be
refused."""

from __future__ import annotations

import binascii
import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.can import CanFrame, CanSettings, Decoder
from drivers.can.readings import DATA_TYPES
from drivers.plausibility import implausible
from drivers.sample import (
    ActuatorCommand,
    AnyReading,
    Clearance,
    GeodeticPosition,
    Inertial,
    MotorSpeed,
    Pressure,
    Sample,
    Velocity,
)
from tests.drivers.can.encoding import fix, frames, message

NAN, INF = math.nan, math.inf
SECOND = 1_000_000_000


def samples_of(payload: Any, decoder: Decoder, *, flexible: bool = False) -> list[Sample]:
    result: list[Sample] = []
    for at, frame in enumerate(frames(payload, flexible=flexible)):
        result += decoder.decode(frame, SECOND + at)
    return result


def readings_of(payload: Any) -> tuple[list[AnyReading], dict[str, int]]:
    decoder = Decoder("bus", CanSettings())
    return [sample.reading for sample in samples_of(payload, decoder)], dict(decoder.malformed)


def passed_over(payload: Any) -> dict[str, int]:
    """Return what a message is passed over for, which must give no reading and be none of the broken."""
    decoder = Decoder("bus", CanSettings())
    assert (samples_of(payload, decoder), decoder.malformed) == ([], {})
    return dict(decoder.unusable)


def test_the_envelope() -> None:
    decoder = Decoder("bus", CanSettings())
    position, velocity = samples_of(fix(), decoder)
    assert (position.link, position.source) == (velocity.link, velocity.source) == ("bus", "gnss.Fix2")
    assert position.time == SECOND  # without a stamp: when the first frame came
    assert position.received == SECOND + 9  # of ten
    assert decoder.messages == 1


@pytest.mark.parametrize("flexible", [False, True])
def test_fix(flexible: bool) -> None:
    position, velocity = samples_of(fix(), Decoder("bus", CanSettings()), flexible=flexible)
    assert isinstance(position.reading, GeodeticPosition)
    assert position.reading.latitude == pytest.approx(math.radians(-35.36326100), abs=1e-12)
    assert position.reading.longitude == pytest.approx(math.radians(149.16523000), abs=1e-12)
    assert position.reading.altitude == pytest.approx(584.0)  # above the sea, not the ellipsoid
    assert (position.reading.sigma_horizontal, position.reading.sigma_vertical) == (0.5, 1.0)
    assert position.reading.satellites == 10
    assert velocity.reading == Velocity(north=1.5, east=-2.25, down=0.125, sigma=0.25)


@pytest.mark.parametrize("status", [0, 1])
def test_no_fix_is_no_position(status: int) -> None:
    assert passed_over(fix(status=status)) == {"gnss.Fix2.status": 1}


def test_a_fix_of_two_dimensions_says_nothing_about_the_vertical() -> None:
    (position, velocity), _ = readings_of(fix(status=2))
    assert isinstance(position, GeodeticPosition)
    assert position.altitude is position.sigma_vertical is None
    assert velocity == Velocity(north=1.5, east=-2.25, sigma=0.25)


def upper_triangle(diagonal: list[float]) -> list[float]:
    return [diagonal[i] if i == j else 0.5 for i in range(6) for j in range(i, 6)]


def full(diagonal: list[float]) -> list[float]:
    return [diagonal[i] if i == j else 0.5 for i in range(6) for j in range(6)]


VARIANCES = [0.25, 0.25, 4.0, 1.0, 1.0, 1.0]


@pytest.mark.parametrize(
    ("covariance", "expected", "refused"),
    [
        ([], (None, None, None), {}),
        ([4.0], (2.0, 2.0, 2.0), {}),
        (VARIANCES, (0.5, 2.0, 1.0), {}),
        (upper_triangle(VARIANCES), (0.5, 2.0, 1.0), {}),
        (full(VARIANCES), (0.5, 2.0, 1.0), {}),
        ([1.0, 2.0, 3.0], (None, None, None), {"gnss.Fix2.covariance": 1}),
        ([NAN, NAN, NAN, 1.0, 1.0, 1.0], (None, None, 1.0), {}),
        ([0.0] * 6, (None, None, None), {}),
    ],
    ids=["unknown", "scalar", "diagonal", "triangle", "full", "other", "NaN", "zero"],
)
def test_the_covariance_is_read_by_its_length(
    covariance: list[float], expected: tuple[float | None, ...], refused: dict[str, int]
) -> None:
    (position, velocity), malformed = readings_of(fix(covariance=covariance))
    assert isinstance(position, GeodeticPosition)
    assert isinstance(velocity, Velocity)
    assert (position.sigma_horizontal, position.sigma_vertical, velocity.sigma) == expected
    assert malformed == refused


@pytest.mark.parametrize(
    ("fields", "refused"),
    [
        ({"latitude_deg_1e8": 90_00000001}, "gnss.Fix2.latitude"),
        ({"longitude_deg_1e8": -180_00001000}, "gnss.Fix2.longitude"),
        ({"ned_velocity": [0.0, NAN, 0.0]}, "gnss.Fix2.east"),
        ({"ned_velocity": [INF, 0.0, 0.0]}, "gnss.Fix2.north"),
        ({"covariance": [-1.0, -1.0, 1.0, 1.0, 1.0, 1.0]}, "gnss.Fix2.sigma_horizontal"),
        ({"covariance": [1.0, 1.0, -1.0, 1.0, 1.0, 1.0]}, "gnss.Fix2.sigma_vertical"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_cannot_be_true_in_a_fix_costs_only_its_reading(fields: dict[str, Any], refused: str) -> None:
    readings, malformed = readings_of(fix(**fields))
    assert len(readings) == 1
    assert malformed == {refused: 1}


def test_the_stamp_of_the_bus_is_mapped_to_the_hosts_clock() -> None:
    """A node 100 s ahead sends at 10 Hz with 5 to 25 ms latency: time follows the stamp, not the arrival."""
    decoder = Decoder("bus", CanSettings())
    worst = 0
    for number in range(50):
        measured = SECOND + number * SECOND // 10
        payload = message("range_sensor.Measurement", range=1.0, reading_type=1)
        payload.timestamp.usec = measured // 1000 + 100_000_000
        latency = 5_000_000 + (number * 7 % 5) * 5_000_000
        sent = frames(payload, number=number % 32)
        for frame in sent:
            for sample in decoder.decode(frame, measured + latency):
                if number > 10:
                    worst = max(worst, abs(sample.time - measured - 5_000_000))
    assert worst < 1_000_000  # the shortest latency cannot be told from an offset
    assert decoder.clock is not None
    assert decoder.clock.offset == pytest.approx(-100.0 + 0.005, abs=0.001)


def test_raw_imu() -> None:
    payload = message(
        "ahrs.RawIMU", rate_gyro_latest=[0.5, -0.25, 0.125], accelerometer_latest=[0.0, 1.5, -9.8125]
    )
    assert readings_of(payload) == (
        [Inertial(angular_velocity=(0.5, -0.25, 0.125), specific_force=(0.0, 1.5, -9.8125))],
        {},
    )


def test_a_broken_accelerometer_does_not_cost_the_gyroscope() -> None:
    payload = message("ahrs.RawIMU", rate_gyro_latest=[0.5, 0.0, 0.0], accelerometer_latest=[0.0, NAN, 0.0])
    readings, malformed = readings_of(payload)
    assert readings == [Inertial(angular_velocity=(0.5, 0.0, 0.0))]
    assert malformed == {"ahrs.RawIMU.specific_force": 1}
    both = message("ahrs.RawIMU", rate_gyro_latest=[INF] * 3, accelerometer_latest=[NAN] * 3)
    assert readings_of(both) == ([], {"ahrs.RawIMU.specific_force": 1, "ahrs.RawIMU.angular_velocity": 1})


def test_a_gyroscope_at_rest_is_a_reading() -> None:
    payload = message("ahrs.RawIMU", rate_gyro_latest=[0.0] * 3, accelerometer_latest=[0.0] * 3)
    assert readings_of(payload)[0] == [Inertial((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))]


def test_magnetic_field_in_tesla() -> None:
    (reading,), _ = readings_of(message("ahrs.MagneticFieldStrength2", magnetic_field_ga=[0.25, -0.5, 0.0]))
    assert isinstance(reading, Inertial)
    assert reading.magnetic_field == pytest.approx((25e-6, -50e-6, 0.0))
    broken = message("ahrs.MagneticFieldStrength2", magnetic_field_ga=[NAN, 0.0, 0.0])
    assert readings_of(broken) == ([], {"ahrs.MagneticFieldStrength2.magnetic_field": 1})


def test_static_pressure() -> None:
    assert readings_of(message("air_data.StaticPressure", static_pressure=101325.0)) == (
        [Pressure(absolute=101325.0)],
        {},
    )
    for wrong in (NAN, INF, 0.0, -5.0):
        assert readings_of(message("air_data.StaticPressure", static_pressure=wrong)) == (
            [],
            {"air_data.StaticPressure.absolute": 1},
        )


def beam(roll: int, pitch: int, yaw: int) -> Any:
    payload = message("range_sensor.Measurement", range=12.5, reading_type=1)
    payload.beam_orientation_in_body_frame.orientation_defined = True
    for index, steps in enumerate((roll, pitch, yaw)):
        payload.beam_orientation_in_body_frame.fixed_axis_roll_pitch_yaw[index] = steps
    return payload


@pytest.mark.parametrize(
    ("angles", "orientation"),
    [
        ((0, 0, 0), 0),
        ((0, 0, 3), 1),  # yaw 45
        ((0, 0, 6), 2),
        ((0, 0, 12), 4),
        ((0, 0, -6), 6),  # yaw 270
        ((0, 0, -3), 7),
        ((7, 6, 0), 24),  # up, and roll plays no part
        ((0, -6, 0), 25),  # down
        ((0, -6, 5), 25),
        ((0, 12, 0), 4),  # pitched over: backwards
        ((0, 1, 0), 100),
        ((0, 0, 1), 100),
    ],
)
def test_where_a_range_finder_looks(angles: tuple[int, int, int], orientation: int) -> None:
    assert readings_of(beam(*angles)) == ([Clearance(distance=12.5, orientation=orientation)], {})


def test_a_range_finder_that_does_not_say_where_it_looks() -> None:
    payload = message("range_sensor.Measurement", range=2.0, reading_type=1)
    assert readings_of(payload)[0] == [Clearance(distance=2.0, orientation=25)]
    (sample,) = samples_of(payload, Decoder("bus", CanSettings(range_orientation=0)))
    assert sample.reading == Clearance(distance=2.0, orientation=0)


@pytest.mark.parametrize("reading_type", [0, 2, 3, 7])
def test_too_close_and_too_far_are_no_ranges(reading_type: int) -> None:
    payload = message("range_sensor.Measurement", range=2.0, reading_type=reading_type)
    assert passed_over(payload) == {"range_sensor.Measurement.reading_type": 1}


@pytest.mark.parametrize("half_float", [0x7E00, 0x7C00, 0xBC00], ids=["NaN", "infinite", "negative"])
def test_a_range_that_is_none(half_float: int) -> None:
    payload = message("range_sensor.Measurement", reading_type=1)
    payload._fields["range"]._bits = f"{half_float:016b}"  # the package's own encoder would saturate
    assert readings_of(payload) == ([], {"range_sensor.Measurement.distance": 1})


def test_motor_speed_in_radians_per_second() -> None:
    (reading,), malformed = readings_of(message("esc.Status", rpm=-3000, esc_index=3, voltage=NAN))
    assert reading == MotorSpeed(index=3, angular_speed=pytest.approx(-100.0 * math.pi))
    assert not malformed  # an unknown voltage is no matter


def test_raw_command() -> None:
    assert readings_of(message("esc.RawCommand", cmd=[8191, 0, -8192, -4096])) == (
        [ActuatorCommand((1.0, 0.0, -1.0, -0.5))],
        {},
    )
    assert passed_over(message("esc.RawCommand", cmd=[])) == {"esc.RawCommand.cmd": 1}


def test_twenty_throttles() -> None:
    commands = [400 * i for i in range(20)]
    (reading,), _ = readings_of(message("esc.RawCommand", cmd=commands))
    assert isinstance(reading, ActuatorCommand)
    assert reading.channels == pytest.approx([c / 8191 for c in commands])


def array_command(*commands: tuple[int, int, float]) -> Any:
    payload = message("actuator.ArrayCommand")
    for actuator, kind, value in commands:
        item = payload.commands.new_item()
        item.actuator_id, item.command_type, item.command_value = actuator, kind, value
        payload.commands.append(item)
    return payload


def test_array_command_by_the_actuators_numbers() -> None:
    payload = array_command((1, 0, 0.5), (3, 4, 1250.0), (4, 4, 0.0))
    assert readings_of(payload) == ([ActuatorCommand((None, 0.5, None, -0.5, None))], {})


def test_array_commands_that_are_no_share_of_full() -> None:
    payload = array_command((0, 1, 0.3), (1, 0, 1.5), (2, 4, 2600.0), (3, 0, NAN), (4, 0, -1.0))
    decoder = Decoder("bus", CanSettings())
    (sample,) = samples_of(payload, decoder)
    assert sample.reading == ActuatorCommand((None, None, None, None, -1.0))
    assert decoder.malformed == {"actuator.ArrayCommand.command_value": 3}
    assert decoder.unusable == {"actuator.ArrayCommand.command_type": 1}
    assert passed_over(array_command((0, 3, 2.0))) == {"actuator.ArrayCommand.command_type": 1}


def test_a_payload_that_ends_early() -> None:
    decoder = Decoder("bus", CanSettings())
    (frame,) = frames(message("air_data.StaticPressure"))
    assert not decoder.decode(frame._replace(data=frame.data[2:]), 0)
    assert decoder.malformed == {"air_data.StaticPressure.truncated": 1}
    assert decoder.messages == 0


def test_transport_and_contents_are_counted_together() -> None:
    decoder = Decoder("bus", CanSettings())
    sent = frames(fix())
    decoder.decode(sent[3], 0)
    samples_of(fix(covariance=[1.0, 2.0]), decoder)
    decoder.decode(CanFrame(0x123, b"\x00", False), 0)
    assert decoder.malformed == {"missing_start": 1, "gnss.Fix2.covariance": 1}
    assert decoder.ignored == 1


def test_another_protocol_is_refused_when_the_settings_are_made() -> None:
    with pytest.raises(ValueError, match="protocol: 'cyphal' cannot be decoded; supported: dronecan, dbc"):
        CanSettings(protocol="cyphal")


@pytest.mark.parametrize("kind", sorted(DATA_TYPES))
@given(payload=st.binary(max_size=300), stamp=st.integers(0, 2**62))
@settings(max_examples=100, deadline=None)
def test_any_payload_gives_plausible_samples_or_counts(kind: int, payload: bytes, stamp: int) -> None:
    """A transfer with a true checksum around bytes at random, as a faulty node sends them."""
    checksum = binascii.crc_hqx(payload, DATA_TYPES[kind].checksum_start)
    stream = payload if len(payload) <= 7 else checksum.to_bytes(2, "little") + payload
    chunks = [stream[i : i + 7] for i in range(0, len(stream), 7)] or [b""]
    decoder = Decoder("bus", CanSettings())
    samples: list[Sample] = []
    for index, chunk in enumerate(chunks):
        tail = 0x80 * (index == 0) | 0x40 * (index == len(chunks) - 1) | 0x20 * (index % 2)
        samples += decoder.decode(CanFrame(kind << 8 | 9, chunk + bytes([tail])), stamp)
    assert samples or decoder.malformed or decoder.messages
    assert all(implausible(sample.reading) is None for sample in samples)
    assert all(sample.time <= sample.received for sample in samples)
