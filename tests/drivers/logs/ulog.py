"""ULog files written by hand, by PX4's description of the format."""

from __future__ import annotations

import struct

START = 1_000_000  # µs since boot
CODES = {
    "uint64_t": "Q", "int32_t": "i", "uint32_t": "I", "uint16_t": "H", "uint8_t": "B", "int8_t": "b", "float": "f",
    "double": "d", "bool": "?",
}  # fmt: skip

FORMATS = {
    "sensor_combined": "uint64_t timestamp;float[3] gyro_rad;float[3] accelerometer_m_s2;"
    "int32_t accelerometer_timestamp_relative;uint8_t[4] _padding0;",
    "vehicle_gps_position": "uint64_t timestamp;uint64_t timestamp_sample;uint64_t time_utc_usec;double latitude_deg;"
    "double longitude_deg;double altitude_msl_m;float eph;float epv;float s_variance_m_s;float vel_n_m_s;"
    "float vel_e_m_s;float vel_d_m_s;float heading;float heading_accuracy;uint8_t fix_type;uint8_t satellites_used;"
    "bool vel_ned_valid;",
    "sensor_gps": "uint64_t timestamp;uint64_t time_utc_usec;int32_t lat;int32_t lon;int32_t alt;float eph;float epv;"
    "float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;uint8_t fix_type;uint8_t satellites_used;bool vel_ned_valid;",
    "vehicle_attitude": "uint64_t timestamp;float[4] q;",
    "vehicle_air_data": "uint64_t timestamp;float baro_pressure_pa;float baro_temp_celcius;",
    "sensor_baro": "uint64_t timestamp;float pressure;float temperature;",
    "vehicle_magnetometer": "uint64_t timestamp;float[3] magnetometer_ga;",
    "distance_sensor": "uint64_t timestamp;float current_distance;float min_distance;float max_distance;"
    "float variance;int8_t signal_quality;uint8_t orientation;",
    "wheel_encoders": "uint64_t timestamp;float[2] wheel_speed;float[2] wheel_angle;",
    "ranging_beacon": "uint64_t timestamp;uint8_t beacon_id;float range;double lat;double lon;float alt;"
    "float range_accuracy;",
    "rpm": "uint64_t timestamp;float rpm_estimate;",
    "vehicle_local_position": "uint64_t timestamp;double ref_lat;double ref_lon;float ref_alt;bool xy_global;",
    "cpuload": "uint64_t timestamp;float load;",
}
IDS = {name: index for index, name in enumerate(FORMATS)}


def codes(name: str) -> str:
    out = "<"
    for field in FORMATS[name].rstrip(";").split(";"):
        kind = field.split()[0]
        base, _, count = kind.partition("[")
        if not field.split()[1].startswith("_padding"):
            out += CODES[base] * int(count.rstrip("]") or 1)
    return out


def message(letter: str, body: bytes) -> bytes:
    return struct.pack("<HB", len(body), ord(letter)) + body


def header() -> bytes:
    return b"ULog\x01\x12\x35\x01" + struct.pack("<Q", START)


def flags(incompatible: int = 0, *offsets: int) -> bytes:
    places = (*offsets, 0, 0, 0)[:3]
    return message("B", bytes(8) + bytes([incompatible]) + bytes(7) + struct.pack("<3Q", *places))


def definitions(*names: str) -> bytes:
    wanted = names or tuple(FORMATS)
    return (
        flags()
        + b"".join(message("F", f"{name}:{FORMATS[name]}".encode()) for name in wanted)
        + b"".join(subscription(name) for name in wanted)
    )


def subscription(name: str, instance: int = 0, identifier: int | None = None) -> bytes:
    number = IDS[name] if identifier is None else identifier
    return message("A", struct.pack("<BH", instance, number) + name.encode())


def data(name: str, *values: object, identifier: int | None = None) -> bytes:
    number = IDS[name] if identifier is None else identifier
    return message("D", struct.pack("<H", number) + struct.pack(codes(name), *values))


def combined(at: int, *gyro: float) -> bytes:
    return data("sensor_combined", at, *(gyro or (0.5, 0.25, 0.125)), 1.0, 2.0, -9.5, 0)


def gps(
    at: int, utc: int, *, fix: int = 3, lat: float = 47.5, speed: float = 3.0, heading: float = float("nan")
) -> bytes:
    return data(
        "vehicle_gps_position", at, at - 100_000, utc, lat, 8.5, 400.0, 0.75, 1.5, 0.25, speed, 4.0, -1.0, heading, 0.0,
        fix, 12, True,
    )  # fmt: skip


SYNC = message("S", b"\x2f\x73\x13\x20\x25\x0c\xbb\x12")
