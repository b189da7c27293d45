"""A vehicle's MAVLink, as fast as asked: python benchmarks/traffic.py PORT RATE SECONDS.

Frames are packed beforehand; stamps and sums are patched in place, so that the sender takes little of the processor
that is measured.
"""

from __future__ import annotations

import contextlib
import json
import os
import socket
import struct
import sys
import time
from typing import Any

import numpy as np

BEACONS = {0: (20.0, 10.0), 1: (-5.0, 20.0), 2: (30.0, -15.0), 3: (-20.0, -10.0)}
SPEED = 1.0
UNKNOWN = 2**31 - 1

_PACKED: dict[str, bytes] = {}


def send(port: int, rate: int, seconds: float) -> None:
    """Send ``rate`` frames a second: a fifth wheels, a fifth gyro, a tenth ranges, the rest attitude."""
    os.environ["MAVLINK20"] = "1"
    os.environ["MAVLINK_DIALECT"] = "all"
    from pymavlink.dialects.v20 import all as dialect

    mav = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    end = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    end.connect(("127.0.0.1", port))
    burst = max(1, rate // 500)
    began, sent = time.monotonic(), 0
    while sent < rate * seconds:
        time.sleep(max(0.0, began + sent / rate - time.monotonic()))
        for _ in range(burst):
            with contextlib.suppress(ConnectionRefusedError):
                end.send(frame(dialect, mav, sent, sent / rate))
            sent += 1
    print(json.dumps({"sent": sent, "seconds": time.monotonic() - began}), flush=True)


def frame(dialect: Any, mav: Any, number: int, elapsed: float) -> bytes:
    """Return one frame, packed beforehand, with its sequence, stamp and check sum of now."""
    if number % 2000 == 0:
        return mav.heartbeat_encode(10, 3, 0, 0, 4).pack(mav)
    stamp = int((elapsed + 100.0) * 1e6)
    turn = number % 10
    north = SPEED * elapsed
    if turn in (0, 5):
        return patched(dialect, mav, "wheels", struct.pack("<Qdd", stamp, north, north), number)
    if turn in (1, 6):
        return patched(dialect, mav, "imu", struct.pack("<Q", stamp), number)
    if turn == 2:
        beacon = number // 10 % len(BEACONS)
        distance = round(1000 * float(np.hypot(north - BEACONS[beacon][0], BEACONS[beacon][1])))
        return mav.ranging_beacon_encode(
            stamp, 0, 0, beacon, distance, UNKNOWN, UNKNOWN, float("nan"), 0, 0, 0, 0, 300, number % 256, 0
        ).pack(mav)
    return patched(dialect, mav, "attitude", struct.pack("<I", stamp // 1000), number)


def patched(dialect: Any, mav: Any, kind: str, head: bytes, number: int) -> bytes:
    """Write ``head`` over the start of a packed payload, and correct sequence and check sum."""
    if kind not in _PACKED:
        full = (1.0,) * 16
        _PACKED[kind] = {
            "wheels": lambda: mav.wheel_distance_encode(2**40, 2, full),
            "imu": lambda: mav.highres_imu_encode(
                2**40, 0, 0, -9.81, 0, 0, 1e-9, 0.2, 0, 0.4, 1013.0, 0, 0, 20.0, 63, 0
            ),
            "attitude": lambda: mav.attitude_encode(2**30, 0, 0, 0, 0, 0, 1e-9),
        }[kind]().pack(mav)
    packed = bytearray(_PACKED[kind])
    packed[4] = number & 0xFF
    packed[10 : 10 + len(head)] = head
    extra = {
        "wheels": dialect.MAVLink_wheel_distance_message.crc_extra,
        "imu": dialect.MAVLink_highres_imu_message.crc_extra,
        "attitude": dialect.MAVLink_attitude_message.crc_extra,
    }[kind]
    total = dialect.x25crc(packed[1:-2])
    total.accumulate(bytes([extra]))
    packed[-2:] = struct.pack("<H", total.crc)
    return bytes(packed)


if __name__ == "__main__":
    send(int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]))
