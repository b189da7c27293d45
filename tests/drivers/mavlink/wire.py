"""Frames packed by hand from the protocol's documents, as the oracle against which the driver is read.

Layouts (fields by size, largest first; extensions last), ids and CRC_EXTRA are typed in from common.xml,
ardupilotmega.xml and development.xml, not taken from pymavlink.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

# name: (id, CRC_EXTRA, layout in wire order)
LAYOUTS: dict[str, tuple[int, int, str]] = {
    "HEARTBEAT": (0, 50, "<IBBBBB"),
    "GPS_RAW_INT": (24, 24, "<QiiiHHHHBBiIIIIH"),
    "SCALED_IMU": (26, 170, "<Ihhhhhhhhhh"),
    "RAW_IMU": (27, 144, "<QhhhhhhhhhBh"),
    "SCALED_PRESSURE": (29, 115, "<Iffhh"),
    "ATTITUDE": (30, 39, "<Iffffff"),
    "SERVO_OUTPUT_RAW": (36, 222, "<IHHHHHHHHBHHHHHHHH"),
    "GPS_GLOBAL_ORIGIN": (49, 39, "<iiiQ"),
    "REQUEST_DATA_STREAM": (66, 148, "<HBBBB"),
    "VFR_HUD": (74, 20, "<ffffhH"),
    "GLOBAL_POSITION_INT": (33, 104, "<IiiiihhhH"),
    "ALTITUDE": (141, 47, "<Qffffff"),
    "COMMAND_LONG": (76, 152, "<fffffffHBBB"),
    "COMMAND_ACK": (77, 143, "<HBBiBB"),
    "POSITION_TARGET_LOCAL_NED": (85, 140, "<IfffffffffffHB"),
    "HIGHRES_IMU": (105, 93, "<QfffffffffffffHB"),
    "SIM_STATE": (108, 32, "<fffffffffffffffffffffii"),
    "TIMESYNC": (111, 34, "<qq"),
    "SCALED_IMU2": (116, 76, "<Ihhhhhhhhhh"),
    "GPS2_RAW": (124, 87, "<QiiiIHHHHBBBHiIIII"),
    "SCALED_IMU3": (129, 46, "<Ihhhhhhhhhh"),
    "DISTANCE_SENSOR": (132, 85, "<IHHHBBBBff4fB"),
    "SCALED_PRESSURE2": (137, 195, "<Iffhh"),
    "RPM": (226, 207, "<ff"),
    "RANGING_BEACON": (513, 99, "<QIiifIIIHHBBBBB"),
    "WHEEL_DISTANCE": (9000, 113, "<Q16dB"),
}
CHECKED = 0xFFFF


def crc(data: bytes) -> int:
    """CRC-16/MCRF4XX, as checksum.h of the C library computes it."""
    accumulated = 0xFFFF
    for byte in data:
        folded = byte ^ (accumulated & 0xFF)
        folded = (folded ^ (folded << 4)) & 0xFF
        accumulated = (accumulated >> 8) ^ (folded << 8) ^ (folded << 3) ^ (folded >> 4)
    return accumulated & 0xFFFF


def payload(name: str, *values: float) -> bytes:
    return struct.pack(LAYOUTS[name][2], *values)


def frame(
    name: str,
    *values: float,
    system: int = 1,
    component: int = 1,
    sequence: int = 0,
    flags: int = 0,
) -> bytes:
    """A MAVLink 2 frame with its zeros cut, without a signature."""
    identifier, extra, _ = LAYOUTS[name]
    body = payload(name, *values).rstrip(b"\0") or b"\0"
    return raw_frame(identifier, extra, body, system, component, sequence, flags)


def raw_frame(
    identifier: int,
    extra: int,
    body: bytes,
    system: int = 1,
    component: int = 1,
    sequence: int = 0,
    flags: int = 0,
) -> bytes:
    head = struct.pack("<BBBBBB", len(body), flags, 0, sequence, system, component)
    head += identifier.to_bytes(3, "little")
    return b"\xfd" + head + body + crc(head + body + bytes((extra,))).to_bytes(2, "little")


def frame_1(name: str, *values: float, system: int = 1, component: int = 1, sequence: int = 0) -> bytes:
    """A MAVLink 1 frame: one byte of id, no zeros cut."""
    identifier, extra, _ = LAYOUTS[name]
    body = payload(name, *values)
    head = bytes((len(body), sequence, system, component, identifier))
    return b"\xfe" + head + body + crc(head + body + bytes((extra,))).to_bytes(2, "little")


def heartbeat(
    system: int = 1, component: int = 1, kind: int = 10, autopilot: int = 3, armed: bool = False
) -> bytes:
    return frame(
        "HEARTBEAT", 0, kind, autopilot, 128 if armed else 0, 4, 3, system=system, component=component
    )


def attitude(boot_ms: int, yaw: float = 0.5, system: int = 1, component: int = 1, sequence: int = 0) -> bytes:
    values = (boot_ms, 0.1, -0.2, yaw, 0.01, 0.02, 0.03)
    return frame("ATTITUDE", *values, system=system, component=component, sequence=sequence)


def gps(
    time_usec: int = 5_000_000,
    fix: int = 3,
    lat: int = 404_433_000,
    lon: int = -799_436_000,
    alt: int = 300_500,
    vel: int = 150,
    cog: int = 9_000,
    satellites: int = 12,
    h_acc: int = 900,
    v_acc: int = 1_700,
    vel_acc: int = 300,
    yaw: int = 0,
    hdg_acc: int = 0,
) -> bytes:
    # eph and epv are dilutions of 1.21 and 2.00: in metres they would be wrong
    return frame(
        "GPS_RAW_INT",
        *(time_usec, lat, lon, alt, 121, 200, vel, cog, fix, satellites),
        *(0, h_acc, v_acc, vel_acc, hdg_acc, yaw),
    )


def wheels(time_usec: int, *distances: float, count: int | None = None) -> bytes:
    padded: Sequence[float] = (*distances, *[0.0] * (16 - len(distances)))
    return frame("WHEEL_DISTANCE", time_usec, *padded, len(distances) if count is None else count)


def beacon(
    time_usec: int = 5_000_000,
    range_mm: int = 12_345,
    identifier: int = 7,
    lat: int = 2**31 - 1,
    lon: int = 2**31 - 1,
    alt: float = float("nan"),
    alt_type: int = 0,
    accuracy: int = 500,
) -> bytes:
    return frame(
        "RANGING_BEACON",
        *(time_usec, range_mm, lat, lon, alt, 50, 50, accuracy, identifier, 0, 0, 0, alt_type, 1, 0),
    )
