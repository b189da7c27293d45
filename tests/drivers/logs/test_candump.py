"""Recordings of can-utils, whole and damaged, plain and zipped."""

from __future__ import annotations

import gzip
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.can import CanFrame, CanSettings
from drivers.logs import LogReader
from drivers.logs.candump import frames as candump_frames
from drivers.logs.candump import parse
from drivers.logs.canlog import CanLogReader
from drivers.sample import GeodeticPosition, Pressure, Velocity
from tests.drivers.can.encoding import fix, frames, message

START_NS = 1_700_000_000_123_456_000
CAR = Path(__file__).parents[4] / "shared" / "data" / "comma2k19_seg40.candump.gz"


def opened(path: Path) -> CanLogReader:
    return CanLogReader(path, "bus", CanSettings(), candump_frames)


def line(frame: CanFrame, at_ns: int, channel: str = "can0") -> str:
    separator = "##1" if frame.flexible else "#"
    seconds, rest = divmod(at_ns, 1_000_000_000)
    stamp = f"({seconds}.{rest // 1000:06d})"
    return f"{stamp} {channel} {frame.identifier:08X}{separator}{frame.data.hex().upper()}"


def lines(payload: object, at_ns: int = START_NS, channel: str = "can0", number: int = 0) -> list[str]:
    return [line(f, at_ns + 1000 * i, channel) for i, f in enumerate(frames(payload, number=number))]


def reader(path: Path, *text: str) -> CanLogReader:
    path.write_text("\n".join(text) + "\n")
    return opened(path)


def test_one_line_by_hand() -> None:
    logged = parse(b"(1700000000.123456) vcan0 1004042A#80E6C547003CC7\n")
    assert logged is not None
    assert logged == (START_NS, "vcan0", CanFrame(0x1004042A, bytes.fromhex("80e6c547003cc7"), True, False))


@pytest.mark.parametrize(
    ("text", "frame"),
    [
        (b"(0.0) can0 123#", CanFrame(0x123, b"", False)),
        (b"(1.5) can0 7FF#aB R", CanFrame(0x7FF, b"\xab", False)),
        (b"(1.5) can0 00000123#AB T", CanFrame(0x123, b"\xab", True)),
        (b"(1.5)  can0  1004042A##3" + b"0F" * 64, CanFrame(0x1004042A, b"\x0f" * 64, True, True)),
        (b"(1.5) can0 1004042A##0", CanFrame(0x1004042A, b"", True, True)),
    ],
)
def test_every_form_of_a_data_frame(text: bytes, frame: CanFrame) -> None:
    logged = parse(text)
    assert logged is not None
    assert logged.frame == frame


@pytest.mark.parametrize("text", [b"(1.5) can0 123#R", b"(1.5) can0 1004042A#R8", b"(1.5) can0 123#r T"])
def test_a_remote_frame_holds_no_data(text: bytes) -> None:
    assert parse(text) is None


@pytest.mark.parametrize(
    "text",
    [
        b"",
        b"hello",
        b"(1.5) can0",
        b"(1.5) can0 123",
        b"(1.5) can0 123#1",
        b"(1.5) can0 123#11223344556677889",
        b"(1.5) can0 123#112233445566778899",
        b"(1.5) can0 12#11",
        b"(1.5) can0 12345#11",
        b"(1.5) can0 123456789#11",
        b"(nan) can0 123#11",
        b"(-1.5) can0 123#11",
        b"(1.5 can0 123#11",
        b"(1.5) can0 123#GG",
        b"(1.5) can0 123##0" + b"00" * 65,
        b"\xff\xfe\x00",
    ],
)
def test_a_damaged_line(text: bytes) -> None:
    with pytest.raises(ValueError, match="bad_line"):
        parse(text)


def test_an_error_frame() -> None:
    with pytest.raises(ValueError, match="error_frame"):
        parse(b"(1.5) can0 20000004#0004000000000000")


@given(st.binary(max_size=100))
@settings(max_examples=300)
def test_any_line_is_a_frame_or_an_error_of_a_known_kind(text: bytes) -> None:
    try:
        logged = parse(text)
    except ValueError as error:
        assert str(error) in {"bad_line", "error_frame"}  # noqa: PT017  either outcome is right
    else:
        assert logged is None or len(logged.frame.data) <= 64


@given(
    st.integers(0, 2**29 - 1),
    st.binary(max_size=8),
    st.integers(0, 2**34),
    st.integers(0, 999_999),
    st.booleans(),
)
def test_what_is_written_is_read(
    identifier: int, data: bytes, seconds: int, micros: int, flexible: bool
) -> None:
    frame = CanFrame(identifier, data, True, flexible)
    at_ns = seconds * 1_000_000_000 + micros * 1000
    assert parse(line(frame, at_ns).encode()) == (at_ns, "can0", frame)


@pytest.mark.parametrize("name", ["drive.log", "drive.log.gz", "zipped_but_called.log"])
def test_a_recording(tmp_path: Path, name: str) -> None:
    text = "\n".join(lines(fix()) + lines(message("air_data.StaticPressure", static_pressure=9e4))) + "\n"
    path = tmp_path / name
    path.write_bytes(text.encode() if name == "drive.log" else gzip.compress(text.encode()))
    log: LogReader = opened(path)
    assert log.position == 0
    samples = list(log)
    assert [type(s.reading) for s in samples] == [GeodeticPosition, Velocity, Pressure]
    assert samples[0].time == START_NS
    assert samples[0].received == START_NS + 9000
    assert {(s.link, s.source) for s in samples[:2]} == {("bus", "gnss.Fix2")}
    assert log.position == log.size == path.stat().st_size
    report = log.report()
    assert (report.messages, report.samples, report.malformed, report.ignored) == (2, 3, {}, 0)
    assert log.kinds() == {"gnss.Fix2": 1, "air_data.StaticPressure": 1}
    assert list(log) == samples  # and begins anew each time
    assert log.report() == report


def test_damage_is_counted_and_ends_nothing(tmp_path: Path) -> None:
    good = [lines(fix(), number=n) for n in range(3)]
    good[1][4] = good[1][4][:-3]  # an odd number of digits
    text = [*good[0], "garbage", "", *good[1], "(1.0) can0 20000040#", "(1.0) can0 123#R", *good[2]]
    log = reader(tmp_path / "damaged.log", *text)
    assert len(list(log)) == 4
    report = log.report()
    assert report.malformed == {"bad_line": 2, "error_frame": 1, "toggle_error": 1}
    assert report.ignored == 1


def test_bytes_that_are_no_text_and_lines_without_end(tmp_path: Path) -> None:
    path = tmp_path / "binary.log"
    path.write_bytes(bytes(range(256)) * 100 + b"\n" + "\n".join(lines(fix())).encode())
    log = opened(path)
    assert len(list(log)) == 2
    assert set(log.report().malformed) == {"bad_line"}


def test_a_zipped_file_cut_short_gives_what_is_there(tmp_path: Path) -> None:
    text = "\n".join(x for n in range(2000) for x in lines(fix(sats_used=n % 64), number=n % 32)).encode()
    whole = gzip.compress(text)
    path = tmp_path / "cut.log.gz"
    path.write_bytes(whole[: len(whole) // 2])
    log = opened(path)
    assert 100 < len(list(log)) < 4000
    assert log.report().malformed["truncated_file"] == 1
    path.write_bytes(whole[: len(whole) // 2] + b"\xff" * 100 + whole[len(whole) // 2 + 100 :])
    damaged = opened(path)
    assert len(list(damaged)) > 100
    assert damaged.report().malformed["truncated_file"] == 1


def test_a_zipped_file_that_is_damaged_at_once(tmp_path: Path) -> None:
    path = tmp_path / "damaged.log.gz"
    path.write_bytes(gzip.compress(b"")[:10] + b"\x07" + bytes(20))  # a block of a type that there is not
    log = opened(path)
    assert not list(log)
    assert log.report().malformed == {"truncated_file": 1}


def test_two_buses_with_the_same_nodes_are_reassembled_apart(tmp_path: Path) -> None:
    one, two = lines(fix(), channel="can0"), lines(fix(sats_used=4), channel="can1")
    log = reader(tmp_path / "two.log", *(x for pair in zip(one, two, strict=True) for x in pair))
    positions = [s.reading for s in log if isinstance(s.reading, GeodeticPosition)]
    assert [p.satellites for p in positions] == [10, 4]
    assert not log.report().malformed


def test_buses_by_the_hundred_are_no_reason_to_grow(tmp_path: Path) -> None:
    one = message("air_data.StaticPressure", static_pressure=9e4)
    log = reader(tmp_path / "many.log", *(x for n in range(100) for x in lines(one, channel=f"can{n}")))
    assert len(list(log)) == 16
    assert log.report().malformed == {"too_many_channels": 84}


def test_the_receive_clock_never_goes_back(tmp_path: Path) -> None:
    one = message("air_data.StaticPressure", static_pressure=9e4)
    times = [START_NS, START_NS + 5000, START_NS + 2000, START_NS + 6000]
    log = reader(
        tmp_path / "crossed.log", *(x for n, at in enumerate(times) for x in lines(one, at, number=n))
    )
    received = [s.received for s in log]
    assert received == sorted(received)
    assert len(received) == 4


def test_an_absent_file_is_an_error_at_once(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        opened(tmp_path / "absent.log")


@pytest.mark.recordings
@pytest.mark.skipif(not CAR.exists(), reason=f"the recording {CAR.name} is not in ../shared/data")
def test_a_minute_of_a_real_car() -> None:
    """135,468 frames with 11-bit identifiers: not DroneCAN, so nothing is understood, and nothing is
    damaged."""
    log = opened(CAR)
    assert not list(log)
    report = log.report()
    assert (report.ignored, report.malformed) == (135_468, {})
    assert sum(log.kinds().values()) == 135_468
    assert log.kinds()["0x0AA"] == 4974  # wheel speeds, 83 Hz
