"""Frames in bytes, against frames packed by hand, and against any bytes at all."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.mavlink.frames import Fault, Frame, FrameScanner, frame_at
from tests.drivers.mavlink import wire
from tests.drivers.mavlink.wire import attitude, frame, frame_1, heartbeat, raw_frame


def scan(*pieces: bytes) -> tuple[list[Frame], dict[str, int]]:
    scanner, frames = FrameScanner(), list[Frame]()
    for piece in pieces:
        scanner.feed(piece, frames.append)
    return frames, dict(scanner.faults)


def test_a_frame_is_read_as_it_was_packed() -> None:
    (found,), faults = scan(attitude(1234, yaw=-2.5))
    fields = found.message().fields
    assert (found.identifier, found.system, found.component, found.signed) == (30, 1, 1, False)
    assert fields.time_boot_ms == 1234
    assert fields.yaw == pytest.approx(-2.5)
    assert fields.pitchspeed == pytest.approx(0.02)
    assert faults == {}


def test_zeros_that_were_cut_come_back() -> None:
    cut = frame("SERVO_OUTPUT_RAW", 77, 1500, *[0] * 16)
    assert len(cut) == 12 + 6
    (found,), _ = scan(cut)
    fields = found.message().fields
    assert (fields.time_usec, fields.servo1_raw, fields.servo2_raw, fields.servo16_raw) == (77, 1500, 0, 0)


def test_a_longer_payload_of_a_newer_definition_is_cut() -> None:
    body = wire.payload("TIMESYNC", 5, 6) + b"\x01\x02"
    (found,), _ = scan(raw_frame(111, 34, body))
    assert tuple(found.message().fields) == (5, 6)


def test_arrays_are_tuples() -> None:
    (found,), _ = scan(wire.wheels(9, 1.0, 2.0))
    fields = found.message().fields
    assert fields.distance == (1.0, 2.0, *[0.0] * 14)
    assert fields.count == 2


def test_mavlink_1_is_read_too() -> None:
    (found,), _ = scan(frame_1("ATTITUDE", 42, 0.1, 0.2, 0.3, 0.0, 0.0, 0.0, system=9, component=3))
    assert (found.system, found.component, found.message().fields.time_boot_ms) == (9, 3, 42)


def test_a_signature_is_skipped_where_no_key_is_set() -> None:
    plain = frame("TIMESYNC", 1, 2, flags=1)
    found, faults = scan(plain + bytes(13) + heartbeat())
    assert [f.identifier for f in found] == [111, 0]
    assert found[0].signed
    assert faults == {}


def test_frames_arrive_in_any_pieces() -> None:
    stream = b"".join(attitude(i) for i in range(20))
    for size in (1, 3, 7, 64):
        pieces = [stream[i : i + size] for i in range(0, len(stream), size)]
        found, faults = scan(*pieces)
        assert [f.message().fields.time_boot_ms for f in found] == list(range(20))
        assert faults == {}


def test_one_wrong_byte_costs_one_frame() -> None:
    """pymavlink loses the frames behind a wrong length; here only the damaged one is lost, counted once."""
    frames = [attitude(i) for i in range(10)]
    for position in range(len(frames[4])):
        damaged = bytearray(frames[4])
        damaged[position] ^= 0x55
        found, faults = scan(b"".join((*frames[:4], bytes(damaged), *frames[5:], *[heartbeat()] * 9)))
        times = [f.message().fields.time_boot_ms for f in found if f.identifier == 30]
        assert times == [0, 1, 2, 3, 5, 6, 7, 8, 9], position
        assert sum(count for fault, count in faults.items() if fault != "lost_bytes") == 1


def test_what_is_wrong_is_named() -> None:
    good = heartbeat()
    assert scan(b"junk" + good)[1] == {"bad_prefix": 1, "lost_bytes": 4}
    assert scan(b"junk" + good + b"more" + good)[1] == {"bad_prefix": 2, "lost_bytes": 8}
    assert scan(good[:-1] + b"\x00" + good)[1] == {"bad_checksum": 1, "lost_bytes": len(good)}
    assert scan(frame("TIMESYNC", 1, 2, flags=4) + good)[1]["unknown_flags"] == 1
    unknown = raw_frame(0xABCDEF, 0, b"hello")
    found, faults = scan(unknown + good)
    assert faults == {"unknown_message": 1}
    assert [f.identifier for f in found] == [0]


def test_an_unknown_message_cannot_be_decoded() -> None:
    found = frame_at(raw_frame(0xABCDEF, 0, b"hello"), 0)
    assert isinstance(found, Frame)
    with pytest.raises(ValueError, match="not in the dialect"):
        found.message()


def test_a_false_unknown_message_swallows_nothing() -> None:
    """A marker in noise that names an unknown id and a length over good frames is not believed."""
    lie = b"\xfd\x20\x00\x00\x00\x01\x01\xef\xcd\xab"
    found, faults = scan(lie + attitude(1) + attitude(2) + attitude(3))
    assert [f.message().fields.time_boot_ms for f in found] == [1, 2, 3]
    assert faults == {"unknown_message": 1, "lost_bytes": len(lie)}


def test_an_ended_stream_is_forgotten() -> None:
    scanner, found = FrameScanner(), list[Frame]()
    scanner.feed(attitude(1)[:-3], found.append)
    scanner.forget()
    scanner.feed(attitude(2), found.append)
    assert [f.message().fields.time_boot_ms for f in found] == [2]
    assert scanner.faults == {}


@given(st.binary(max_size=600), st.integers(0, 600))
def test_no_bytes_raise(data: bytes, start: int) -> None:
    found = frame_at(data, start)
    assert isinstance(found, (Frame, Fault))


@given(st.lists(st.binary(max_size=80), max_size=8), st.integers(0, 3))
def test_noise_is_counted_and_what_follows_is_heard(noise: list[bytes], cut: int) -> None:
    """Whatever came before, frames enough to outlast the longest false length are understood again."""
    scanner, found = FrameScanner(), list[Frame]()
    for piece in noise:
        scanner.feed(piece[: len(piece) - cut], found.append)
    for index in range(12):
        scanner.feed(attitude(1_000_000 + index), found.append)
    times = [f.message().fields.time_boot_ms for f in found if f.identifier == 30]
    assert times[-1] == 1_000_011
    assert len(scanner._buffer) < 300
    assert set(scanner.faults) <= {*Fault, "lost_bytes"}


@given(st.data())
def test_mutated_streams_lose_little(data: st.DataObject) -> None:
    frames = [attitude(i) for i in range(30)]
    stream = bytearray(b"".join(frames))
    hits = data.draw(st.lists(st.integers(0, len(stream) - 1), max_size=4))
    for hit in hits:
        stream[hit] = data.draw(st.integers(0, 255))
    found, _ = scan(bytes(stream), b"".join([heartbeat()] * 14))
    times = {f.message().fields.time_boot_ms for f in found if f.identifier == 30}
    assert len(times & set(range(30))) >= 30 - len(hits)
