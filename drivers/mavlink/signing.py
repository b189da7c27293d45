"""Message signing (MAVLink 2): whether a frame is from some one who holds the key, and new.

The signature is the first six bytes of SHA-256 over the key, the frame, the link id and a time stamp in units
of 10 µs since 2015, which must grow within one stream (https://mavlink.io/en/guide/message_signing.html).
pymavlink's check remembers the stamp of a frame before it has verified it, so that one forged frame silences
the true sender.
"""

from __future__ import annotations

import hashlib
import hmac
import time
from pathlib import Path

from drivers.link import LinkError
from drivers.mavlink.dialect import SIGNATURE_LENGTH
from drivers.mavlink.frames import Frame

KEY_LENGTH = 32
SINCE_2015 = 1_420_070_400  # Unix seconds of 2015-01-01
PER_SECOND = 100_000
OLDEST = 60 * PER_SECOND


def read_key(path: str) -> bytes:
    """Read a key of 32 bytes, or of 64 hexadecimal digits.

    Raises
    ------
    LinkError
        The file is absent or holds something else.
    """
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise LinkError(f"signing_key_file {path}: {error.strerror}; needs a readable file") from error
    if len(content) == KEY_LENGTH:
        return content
    try:
        key = bytes.fromhex(content.decode("ascii"))
    except (UnicodeDecodeError, ValueError):
        key = b""
    if len(key) != KEY_LENGTH:
        raise LinkError(
            f"signing_key_file {path}: needs 32 bytes or 64 hexadecimal digits, got {len(content)} bytes"
        )
    return key


def stamp_now() -> int:
    """Return the time for a signature: 10 µs since 2015, by the wall clock, as the protocol wants."""
    return int((time.time() - SINCE_2015) * PER_SECOND)


class SignatureCheck:
    """Verifies frames against one key; a stamp that does not grow within its stream is a replay."""

    def __init__(self, key: bytes) -> None:
        self._key = key
        self._latest: dict[tuple[int, int, int], int] = {}
        self._newest = stamp_now()

    def fault(self, frame: Frame) -> str | None:
        """Return why a frame is refused: ``unsigned``, ``bad_signature``, ``replayed``; else ``None``."""
        if not frame.signed:
            return "unsigned"
        signed, signature = frame.raw[:-6], frame.raw[-6:]
        if not hmac.compare_digest(hashlib.sha256(self._key + signed).digest()[:6], signature):
            return "bad_signature"
        link = frame.raw[-SIGNATURE_LENGTH]
        stamp = int.from_bytes(frame.raw[-12:-6], "little")
        stream = (link, frame.system, frame.component)
        if stamp <= self._latest.get(stream, self._newest - OLDEST - 1):
            return "replayed"
        self._latest[stream] = stamp
        self._newest = max(self._newest, stamp)
        return None
