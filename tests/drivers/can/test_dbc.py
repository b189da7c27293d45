"""A car's bus by a DBC file: against cantools' encoder, by hand, and with frames that are damaged."""

from __future__ import annotations

import math
import uuid
from pathlib import Path
from typing import Any

import can
import cantools.database
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.can import CanFrame, CanLink, CanSettings, FrameDecoder, SignalSettings, decoder_of
from drivers.can.database import DbcError, read
from drivers.can.dbc import DbcDecoder, group_of
from drivers.can.decoder import Filter
from drivers.can.units import MEASURES, contradicts, factor, si_unit
from drivers.sample import (
    Altitude,
    AnyReading,
    Clearance,
    Heading,
    MotorSpeed,
    Odometer,
    Pressure,
    Range,
    Rotation,
    Speed,
)

SECOND = 1_000_000_000
DBC = """VERSION ""
NS_ :
BS_:
BU_: XXX
BO_ 180 SPEED: 8 XXX
 SG_ ENCODER : 39|8@0+ (1,0) [0|255] "" XXX
 SG_ SPEED : 47|16@0+ (0.01,0) [0|250] "km/h" XXX
BO_ 170 WHEELS: 8 XXX
 SG_ FR : 7|16@0+ (0.01,-67.67) [0|250] "km/h" XXX
 SG_ FL : 23|16@0+ (0.01,-67.67) [0|250] "km/h" XXX
BO_ 36 KINEMATICS: 8 XXX
 SG_ YAW_RATE : 1|10@0+ (0.244,-125) [0|65535] "deg/s" XXX
BO_ 200 COUNTERS: 4 XXX
 SG_ RIGHT : 16|16@1+ (0.5,0) [0|0] "cm" XXX
 SG_ LEFT : 0|16@1+ (0.5,0) [0|0] "cm" XXX
BO_ 300 PAGES: 8 XXX
 SG_ PAGE M : 0|8@1+ (1,0) [0|0] "" XXX
 SG_ HEADING m0 : 8|16@1+ (0.01,0) [0|360] "degrees" XXX
 SG_ ALTITUDE m1 : 8|16@1- (1,0) [0|0] "ft" XXX
 SG_ PRESSURE m1 : 24|16@1+ (1,0) [0|0] "hPa" XXX
BO_ 2566844926 GROUP: 8 XXX
 SG_ RPM : 24|16@1+ (0.125,0) [0|8031.875] "rpm" XXX
BO_ 2147484647 EXTENDED: 64 XXX
 SG_ FLOAT : 0|32@1- (1,0) [0|0] "m/s" XXX
 SG_ LAST : 504|8@1+ (0.5,0) [0|0] "m" XXX
BO_ 400 PARKING: 2 XXX
 SG_ NEAR : 0|8@1+ (2,0) [0|500] "cm" XXX
 SG_ ODD : 8|8@1+ (1,0) [0|500] "furlong" XXX
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_DEF_ "ProtocolType" STRING ;
BA_DEF_DEF_ "ProtocolType" "";
BA_ "VFrameFormat" BO_ 2566844926 3;
BA_ "VFrameFormat" BO_ 2147484647 1;
SIG_VALTYPE_ 2147484647 FLOAT : 1;
VAL_ 400 NEAR 255 "SNA" 254 "ERROR" ;
"""


@pytest.fixture(scope="module")
def dbc(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("dbc") / "car.dbc"
    path.write_text(DBC)
    return str(path)


@pytest.fixture(scope="module")
def oracle() -> Any:
    return cantools.database.load_string(DBC, "dbc", strict=False)


def signal(name: str, measures: str, **facts: Any) -> SignalSettings:
    return SignalSettings(signal=name, measures=measures, **facts)


def decoder(dbc: str, *signals: SignalSettings) -> FrameDecoder:
    return decoder_of("bus", CanSettings(protocol="dbc", dbc=dbc, signals=signals))


def frame(oracle: Any, name: str, **values: float) -> CanFrame:
    message = oracle.get_message_by_name(name)
    data = message.encode({**dict.fromkeys((s.name for s in message.signals), 0), **values}, strict=False)
    return CanFrame(message.frame_id, bytes(data), message.is_extended_frame, len(data) > 8)


def readings(decoding: FrameDecoder, frames: list[CanFrame], step: int = SECOND // 10) -> list[AnyReading]:
    return [s.reading for i, one in enumerate(frames) for s in decoding.decode(one, SECOND + i * step)]


def test_a_speed_by_hand(dbc: str) -> None:
    """0x0B7A is 2,938 hundredths of a kilometre per hour, in a frame of the recorded Toyota."""
    decoding = decoder(dbc, signal("SPEED.SPEED", "speed", sigma=0.1))
    (sample,) = decoding.decode(CanFrame(0xB4, bytes.fromhex("000000001d0b7a5e"), False), 5)
    assert sample.reading == Speed(pytest.approx(29.38 / 3.6), 0.1)
    assert (sample.time, sample.received, sample.link, sample.source) == (5, 5, "bus", "SPEED.SPEED")
    assert (decoding.messages, decoding.ignored, decoding.clock) == (1, 0, None)


def test_scale_sign_and_offset(dbc: str, oracle: Any) -> None:
    turn = frame(oracle, "KINEMATICS", YAW_RATE=-10.0)
    raw = oracle.decode_message(36, turn.data)["YAW_RATE"]
    plain = decoder(dbc, signal("KINEMATICS.YAW_RATE", "yaw_rate"))
    assert readings(plain, [turn]) == [Rotation(pytest.approx(math.radians(raw)))]
    other = decoder(dbc, signal("KINEMATICS.YAW_RATE", "yaw_rate", scale=0.02, offset=0.5, reversed=True))
    assert readings(other, [turn]) == [Rotation(pytest.approx(-0.02 * raw + 0.5))]


def test_wheel_speeds_of_one_message_roll_up(dbc: str, oracle: Any) -> None:
    """At 36 and 72 km/h for a second: 10 and 20 m; the order is by index, whatever the file's is."""
    wheels = (signal("WHEELS.FR", "wheel_speed", index=1), signal("WHEELS.FL", "wheel_speed", index=0))
    decoding = decoder(dbc, *wheels)
    found = readings(decoding, [frame(oracle, "WHEELS", FL=36.0, FR=72.0)] * 11)
    assert found[0] == Odometer((0.0, 0.0), 0)
    assert found[-1] == Odometer((pytest.approx(10.0, abs=0.02), pytest.approx(20.0, abs=0.02)), 0)
    (late,) = decoding.decode(frame(oracle, "WHEELS", FL=36.0, FR=72.0), 10 * SECOND)
    assert late.reading.epoch == 1
    assert late.source == "WHEELS"


def test_a_wheel_that_cannot_be_is_not_rolled(dbc: str, oracle: Any) -> None:
    decoding = decoder(dbc, signal("WHEELS.FL", "wheel_speed", scale=10.0))
    assert readings(decoding, [frame(oracle, "WHEELS", FL=72.0)]) == []
    assert decoding.malformed == {"WHEELS.value": 1}


def test_counters_that_start_anew_when_their_bits_are_used_up(dbc: str, oracle: Any) -> None:
    """16 bits of half a centimetre: 327.68 m. A jump that no wheel can roll is a new count."""
    wheels = (signal("COUNTERS.LEFT", "distance", index=0), signal("COUNTERS.RIGHT", "distance", index=1))
    marks = [(32_700, 100), (32_750, 150), (32, 200), (82, 250), (10_000, 300), (10_050, 350)]
    log = [frame(oracle, "COUNTERS", LEFT=left, RIGHT=right) for left, right in marks]
    found = readings(decoder(dbc, *wheels), log)
    assert [one.epoch for one in found] == [0, 0, 0, 0, 1, 1]
    assert found[3].distance == pytest.approx((1.5, 1.5))
    assert found[5].distance == pytest.approx((2.0, 2.0))


def test_only_what_the_multiplexer_has_switched_on(dbc: str, oracle: Any) -> None:
    wanted = (
        signal("PAGES.HEADING", "heading"), signal("PAGES.ALTITUDE", "altitude"), signal("PAGES.PRESSURE", "pressure"),
    )  # fmt: skip
    decoding = decoder(dbc, *wanted)
    heading = CanFrame(300, b"\x00" + (27_000).to_bytes(2, "little") + bytes(5), False)
    other = CanFrame(
        300, b"\x01" + (1_000).to_bytes(2, "little") + (950).to_bytes(2, "little") + bytes(3), False
    )
    assert readings(decoding, [heading, other]) == [
        Heading(pytest.approx(-math.pi / 2)),
        Altitude(pytest.approx(304.8)),
        Pressure(95_000.0),
    ]
    assert not decoding.malformed
    assert readings(decoding, [CanFrame(300, b"\x07" + bytes(7), False)]) == []
    assert decoding.malformed == {"PAGES.multiplexer": 1}


def test_a_group_of_j1939_from_any_source(dbc: str) -> None:
    decoding = decoder(dbc, signal("GROUP.RPM", "motor_speed", index=2))
    data = bytes(3) + (8_000).to_bytes(2, "little") + bytes(3)
    for identifier in (0x18FEF1FE, 0x0CFEF121):
        assert readings(decoding, [CanFrame(identifier, data)]) == [
            MotorSpeed(2, pytest.approx(1_000 * math.tau / 60))
        ]
    assert readings(decoding, [CanFrame(0x18FEF2FE, data), CanFrame(0x0FE, data, False)]) == []
    assert decoding.filters == [Filter(0x00FEF100, 0x3FFFF00, True)]
    assert group_of(0x18EA2101) == 0x00EA0000


def test_can_fd_and_extended_identifiers(dbc: str, oracle: Any) -> None:
    wanted = (signal("EXTENDED.FLOAT", "speed"), signal("EXTENDED.LAST", "range", beacon=7, sigma=0.2))
    decoding = decoder(dbc, *wanted)
    full = frame(oracle, "EXTENDED", FLOAT=2.5, LAST=12.5)
    assert full.extended
    assert len(full.data) == 64
    assert readings(decoding, [full, full._replace(flexible=False)]) == [Speed(2.5), Range(7, 12.5, 0.2)] * 2
    assert readings(decoding, [full._replace(extended=False)]) == []
    assert readings(decoding, [full._replace(data=full.data[:8])]) == [Speed(2.5)]
    assert decoding.malformed == {"EXTENDED.cut_short": 1}
    infinite = full._replace(data=b"\x00\x00\x80\x7f" + full.data[4:])
    assert readings(decoding, [infinite]) == [Range(7, 12.5, 0.2)]
    assert decoding.malformed["EXTENDED.FLOAT.value"] == 1


def test_a_value_with_a_name_is_no_measurement(dbc: str) -> None:
    decoding = decoder(dbc, signal("PARKING.NEAR", "clearance"))
    near, unknown = CanFrame(400, b"\x32\x00", False), CanFrame(400, b"\xff\x00", False)
    assert readings(decoding, [near, unknown]) == [Clearance(1.0, 25)]
    assert decoding.unusable == {"PARKING.NEAR": 1}


def test_what_cannot_be_true_is_refused(dbc: str, oracle: Any) -> None:
    decoding = decoder(dbc, signal("SPEED.SPEED", "speed", scale=1e3))
    assert readings(decoding, [frame(oracle, "SPEED", SPEED=200.0)]) == []
    assert decoding.malformed == {"SPEED.SPEED.speed": 1}


def test_filters_and_the_census(dbc: str) -> None:
    decoding = decoder(dbc, signal("SPEED.SPEED", "speed"), signal("EXTENDED.FLOAT", "speed"))
    assert decoding.filters == [Filter(180, 0x7FF, False), Filter(999, 0x1FFFFFFF, True)]
    census = decoding.census()
    for one in (
        CanFrame(180, b"", False),
        CanFrame(180, b"", False),
        CanFrame(0x7FF, b"", False),
        CanFrame(1, b""),
    ):
        census.count(one)
    assert census.kinds() == {"SPEED": 2, "0x7FF": 1, "0x00000001": 1}
    for identifier in range(5_000):
        census.count(CanFrame(identifier, b""))
    assert census.kinds()["others"] == 4_999 - (4_096 - 3)


def test_what_the_file_does_not_hold(dbc: str, tmp_path: Path) -> None:
    with pytest.raises(DbcError, match=r"car\.dbc: there is no message SPED in it"):
        decoder(dbc, signal("SPED.SPEED", "speed"))
    with pytest.raises(DbcError, match="message SPEED has no signal SPED"):
        decoder(dbc, signal("SPEED.SPED", "speed"))
    with pytest.raises(DbcError, match="'furlong', which is no known unit of range; say the scale to m"):
        decoder(dbc, signal("PARKING.ODD", "range", beacon=1))
    with pytest.raises(DbcError, match=r"absent\.dbc: cannot be read: No such file"):
        decoder(str(tmp_path / "absent.dbc"), signal("A.B", "speed"))
    wrong = tmp_path / "wrong.dbc"
    wrong.write_bytes(b"\xff\xfenothing of the kind")
    with pytest.raises(DbcError, match=r"wrong\.dbc: not a DBC file"):
        decoder(str(wrong), signal("A.B", "speed"))
    with pytest.raises(ValueError, match="needs a DBC file and at least one signal"):
        CanSettings(protocol="dbc", dbc=dbc)


def test_a_file_with_signs_of_either_code_page(tmp_path: Path) -> None:
    for encoding in ("cp1252", "utf-8"):
        path = tmp_path / f"{encoding}.dbc"
        path.write_bytes(DBC.replace('"deg/s"', '"°/s"').encode(encoding))
        assert read(str(path)).messages["KINEMATICS"].signals["YAW_RATE"].unit == "°/s"


def test_units() -> None:
    assert factor("speed", "km/h") == pytest.approx(1 / 3.6)
    assert factor("speed", " KPH ") == pytest.approx(1 / 3.6)
    assert factor("yaw_rate", "degrees/s") == factor("yaw_rate", "°/s") == pytest.approx(math.pi / 180)
    assert factor("heading", "km/h") is None
    assert contradicts("speed", "km/h", -0.2778) is None
    assert contradicts("speed", "km/h", 1.0) == pytest.approx(1 / 3.6)
    assert contradicts("speed", "furlongs", 1.0) is None
    for measures in MEASURES:
        assert factor(measures, si_unit(measures)) == 1.0


ALL = (
    signal("SPEED.SPEED", "speed"), signal("WHEELS.FR", "wheel_speed"), signal("COUNTERS.LEFT", "distance"),
    signal("KINEMATICS.YAW_RATE", "yaw_rate"), signal("PAGES.HEADING", "heading"), signal("PAGES.ALTITUDE", "altitude"),
    signal("GROUP.RPM", "motor_speed"), signal("EXTENDED.FLOAT", "speed"), signal("EXTENDED.LAST", "range", beacon=1),
    signal("PARKING.NEAR", "clearance"),
)  # fmt: skip


@given(
    st.lists(
        st.tuples(
            st.sampled_from([36, 170, 180, 200, 300, 400, 999, 0x18FEF1FE, 5]),
            st.binary(max_size=64),
            st.booleans(),
        ),
        max_size=20,
    )
)
@settings(max_examples=200, deadline=None)
def test_any_frames_give_plausible_samples_or_counts(dbc: str, sent: list[tuple[int, bytes, bool]]) -> None:
    decoding = DbcDecoder("bus", CanSettings(protocol="dbc", dbc=dbc, signals=ALL))
    for i, (identifier, data, extended) in enumerate(sent):
        for sample in decoding.decode(CanFrame(identifier, data, extended, len(data) > 8), i * SECOND):
            assert sample.link == "bus"
    assert decoding.messages + decoding.ignored <= len(sent)


def test_a_live_bus(dbc: str, oracle: Any) -> None:
    """The same decoder behind python-can: a remote frame and a stranger are ignored."""
    channel = f"dbc-{uuid.uuid4()}"
    facts = CanSettings(
        interface="virtual",
        channel=channel,
        protocol="dbc",
        dbc=dbc,
        signals=(signal("SPEED.SPEED", "speed"),),
    )
    link = CanLink("bus", facts)
    link.open()
    try:
        with can.Bus(channel, "virtual") as sender:
            sent = frame(oracle, "SPEED", SPEED=36.0)
            sender.send(can.Message(arbitration_id=sent.identifier, data=sent.data, is_extended_id=False))
            sender.send(can.Message(arbitration_id=5, is_extended_id=False))
            sender.send(can.Message(arbitration_id=180, is_remote_frame=True, is_extended_id=False))
            samples = [sample for _ in range(3) for sample in link.poll(1.0)]
        assert [sample.reading for sample in samples] == [Speed(pytest.approx(10.0))]
        report = link.report()
        assert (report.messages, report.ignored, report.clock) == (1, 2, "arrival")
    finally:
        link.close()


def test_a_link_without_its_file_is_refused(tmp_path: Path) -> None:
    facts = CanSettings(protocol="dbc", dbc=str(tmp_path / "absent.dbc"), signals=(signal("A.B", "speed"),))
    with pytest.raises(ValueError, match=r"absent\.dbc: cannot be read"):
        CanLink("bus", facts)
