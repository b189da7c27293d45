"""Signatures against hand-made ones, and ours against pymavlink's check."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from drivers.link import LinkError
from drivers.mavlink.dialect import mavlink
from drivers.mavlink.frames import Frame, frame_at
from drivers.mavlink.signing import PER_SECOND, SignatureCheck, read_key, stamp_now
from drivers.mavlink.speaker import Speaker
from tests.drivers.mavlink.wire import frame, heartbeat

KEY = bytes(range(32))


def signed(stamp: int, key: bytes = KEY, link: int = 1) -> Frame:
    """TIMESYNC with a signature as the protocol's guide says."""
    unsigned = frame("TIMESYNC", 1, 2, flags=1) + bytes((link,)) + stamp.to_bytes(6, "little")
    found = frame_at(unsigned + hashlib.sha256(key + unsigned).digest()[:6], 0)
    assert isinstance(found, Frame)
    return found


def test_what_is_signed_with_the_key_is_believed_once() -> None:
    check, now = SignatureCheck(KEY), stamp_now()
    assert check.fault(signed(now)) is None
    assert check.fault(signed(now)) == "replayed"
    assert check.fault(signed(now + 1)) is None
    assert check.fault(signed(now, link=2)) is None


def test_what_is_not_signed_or_badly_is_refused() -> None:
    check = SignatureCheck(KEY)
    plain = frame_at(heartbeat(), 0)
    assert isinstance(plain, Frame)
    assert check.fault(plain) == "unsigned"
    assert check.fault(signed(stamp_now(), key=bytes(32))) == "bad_signature"


def test_a_forgery_does_not_silence_the_true_sender() -> None:
    """pymavlink's check remembers the forged stamp; this one does not."""
    check, now = SignatureCheck(KEY), stamp_now()
    assert check.fault(signed(now + 10**9, key=bytes(32))) == "bad_signature"
    assert check.fault(signed(now)) is None


def test_a_recording_of_another_day_is_a_replay() -> None:
    check = SignatureCheck(KEY)
    assert check.fault(signed(stamp_now() - 3_600 * PER_SECOND)) == "replayed"


def test_pymavlink_believes_what_we_sign() -> None:
    speaker = Speaker(1, 197, KEY)
    peer = mavlink.MAVLink(None)
    peer.signing.secret_key = KEY
    assert peer.parse_char(speaker.heartbeat()).get_signed()
    found = frame_at(speaker.heartbeat(), 0)
    assert isinstance(found, Frame)
    assert SignatureCheck(KEY).fault(found) is None


def test_keys_are_bytes_or_digits(tmp_path: Path) -> None:
    path = tmp_path / "key"
    path.write_bytes(KEY)
    assert read_key(str(path)) == KEY
    path.write_text(KEY.hex() + "\n")
    assert read_key(str(path)) == KEY


@pytest.mark.parametrize("content", [b"", b"short", b"zz" * 32, bytes(33), b"\xff" * 64])
def test_what_is_no_key_says_so(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "key"
    path.write_bytes(content)
    with pytest.raises(LinkError, match="32 bytes or 64 hexadecimal digits"):
        read_key(str(path))


def test_an_absent_key_says_so(tmp_path: Path) -> None:
    with pytest.raises(LinkError, match="No such file"):
        read_key(str(tmp_path / "none"))
