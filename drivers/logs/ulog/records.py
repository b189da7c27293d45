"""What PX4's topics say, as readings: one small handler for each.

Fields are in the topics' own units, which are SI but for angles of position (degrees, or 1e-7 of them), altitudes
(metres, or millimetres) and magnetic fields (gauss). The topics of PX4's estimator are no sensors and are left alone,
but for the attitude, as on MAVLink.
"""

from __future__ import annotations

import math

from drivers.logs.onboard import Fields, Handler, Notes
from drivers.mavlink.inertial import GAUSS, HECTOPASCAL, KELVIN, LARGEST_FIELD, LARGEST_FORCE, LARGEST_RATE
from drivers.sample import (
    AnyReading,
    Attitude,
    Clearance,
    GeodeticPosition,
    Heading,
    Inertial,
    MotorSpeed,
    Origin,
    Pressure,
    Range,
    Vector,
    Velocity,
)

FIX_2D, FIX_3D = 2, 3
MOST_MILLIBAR = 2000.0  # no pressure of air in pascal is as low below 27 km
DEGREE = math.pi / 180.0
RPM = math.tau / 60.0


def _vector(fields: Fields, name: str, largest: float, factor: float = 1.0) -> Vector | None:
    """Return the vector of an array, ``None`` where it is not finite or longer than it can be."""
    x, y, z = (fields[f"{name}[{axis}]"] * factor for axis in range(3))
    return (x, y, z) if math.sqrt(x * x + y * y + z * z) <= largest else None


def _positive(value: float | None) -> float | None:
    """Return a sigma; 0 and NaN are how a driver says that it does not know."""
    return value if value is not None and math.isfinite(value) and value > 0.0 else None


def sensor_combined(fields: Fields, notes: Notes) -> list[AnyReading]:
    """Gyro and accelerometer; the latter may have gone (a relative stamp that is INT32_MAX)."""
    rate = _vector(fields, "gyro_rad", LARGEST_RATE)
    force = None
    if fields.get("accelerometer_timestamp_relative", 0.0) != 2**31 - 1:
        force = _vector(fields, "accelerometer_m_s2", LARGEST_FORCE)
        notes.malformed["sensor_combined.accelerometer_m_s2"] += force is None
    notes.malformed["sensor_combined.gyro_rad"] += rate is None
    return [] if rate is None and force is None else [Inertial(rate, force)]


def vehicle_magnetometer(fields: Fields, notes: Notes) -> list[AnyReading]:
    """The calibrated field of the magnetometer in use."""
    field = _vector(fields, "magnetometer_ga", LARGEST_FIELD, GAUSS)
    if field is None:
        notes.malformed["vehicle_magnetometer.magnetometer_ga"] += 1
        return []
    return [Inertial(magnetic_field=field)]


def vehicle_air_data(fields: Fields, _notes: Notes) -> list[AnyReading]:
    """Pressure and temperature; the topic has misspelt Celsius for years."""
    celsius = fields.get("baro_temp_celcius", fields.get("ambient_temperature"))
    known = celsius is not None and math.isfinite(celsius)
    return [Pressure(fields["baro_pressure_pa"], temperature=celsius + KELVIN if celsius and known else None)]


def sensor_baro(fields: Fields, notes: Notes) -> list[AnyReading]:
    """One barometer, where nobody has chosen among them: in pascal since PX4 1.13, before that in millibar."""
    pressure = fields["pressure"]
    if not math.isfinite(pressure):
        notes.malformed["sensor_baro.pressure"] += 1
        return []
    celsius = fields.get("temperature", math.nan)
    temperature = celsius + KELVIN if math.isfinite(celsius) else None
    return [
        Pressure(pressure * HECTOPASCAL if pressure < MOST_MILLIBAR else pressure, temperature=temperature)
    ]


def vehicle_attitude(fields: Fields, notes: Notes) -> list[AnyReading]:
    """The autopilot's attitude, a quaternion w, x, y, z from body to north-east-down."""
    w, x, y, z = (fields[f"q[{index}]"] for index in range(4))
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    if not 0.9 < norm < 1.1:
        notes.malformed["vehicle_attitude.q"] += 1
        return []
    sine = max(-1.0, min(1.0, 2.0 * (w * y - z * x) / norm**2))
    return [
        Attitude(
            math.atan2(2.0 * (w * x + y * z), w * w - x * x - y * y + z * z),
            math.asin(sine),
            math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z),
        )
    ]


def distance_sensor(fields: Fields, notes: Notes) -> list[AnyReading]:
    """A range finder; beyond its limits it repeats the limit, and a quality of 0 is none."""
    distance = fields["current_distance"]
    low, high = fields.get("min_distance", 0.0), fields.get("max_distance", 0.0)
    if not low < distance or (high > 0.0 and distance >= high):
        notes.unusable["distance_sensor.current_distance"] += 1
        return []
    if fields.get("signal_quality", -1.0) == 0.0:
        notes.unusable["distance_sensor.signal_quality"] += 1
        return []
    variance = _positive(fields.get("variance"))
    sigma = None if variance is None else math.sqrt(variance)
    return [Clearance(distance, int(fields.get("orientation", 25)), sigma)]


def wheel_encoders(fields: Fields, _notes: Notes) -> list[AnyReading]:
    """Angular speeds of up to two wheels."""
    names = [name for name in ("wheel_speed[0]", "wheel_speed[1]") if name in fields]
    return [MotorSpeed(index, fields[name]) for index, name in enumerate(names)]


def rpm(fields: Fields, _notes: Notes) -> list[AnyReading]:
    """One tachometer."""
    value = fields.get("rpm_estimate", fields.get("indicated_frequency_rpm"))
    return [] if value is None else [MotorSpeed(0, value * RPM)]


def ranging_beacon(fields: Fields, notes: Notes) -> list[AnyReading]:
    """The distance to a beacon, and where that stands if it says so."""
    distance = fields["range"]
    if not distance > 0.0:
        notes.unusable["ranging_beacon.range"] += 1
        return []
    latitude, longitude = fields.get("lat", math.nan), fields.get("lon", math.nan)
    placed = math.isfinite(latitude) and math.isfinite(longitude) and (latitude, longitude) != (0.0, 0.0)
    altitude = fields.get("alt", math.nan)
    return [
        Range(
            int(fields["beacon_id"]),
            distance,
            _positive(fields.get("range_accuracy")),
            latitude * DEGREE if placed else None,
            longitude * DEGREE if placed else None,
            altitude if placed and math.isfinite(altitude) else None,
        )
    ]


def _place(fields: Fields) -> tuple[float, float, float]:
    """Return latitude and longitude in degrees, altitude in metres; before 2023 all were integers."""
    if "latitude_deg" in fields:
        return fields["latitude_deg"], fields["longitude_deg"], fields["altitude_msl_m"]
    return fields["lat"] * 1e-7, fields["lon"] * 1e-7, fields["alt"] * 1e-3


class _Receiver:
    """vehicle_gps_position, or sensor_gps where only that is logged: the former repeats the latter."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._last = -1.0

    def __call__(self, fields: Fields, notes: Notes) -> list[AnyReading]:
        kind = fields["fix_type"]
        if kind < FIX_2D:
            notes.unusable[f"{self._name}.fix_type"] += 1
            return []
        if fields.get("time_utc_usec") and fields["time_utc_usec"] == self._last:
            notes.unusable[f"{self._name}.time_utc_usec"] += 1
            return []
        self._last = fields.get("time_utc_usec", -1.0)
        latitude, longitude, altitude = _place(fields)
        if latitude == 0.0 and longitude == 0.0:
            notes.malformed[f"{self._name}.lat"] += 1
            return []
        full = kind >= FIX_3D
        position = GeodeticPosition(
            latitude * DEGREE,
            longitude * DEGREE,
            altitude if full else None,
            _positive(fields.get("eph")),
            _positive(fields.get("epv")) if full else None,
            int(fields["satellites_used"]) if "satellites_used" in fields else None,
        )
        return [position, *self._velocity(fields, full), *self._heading(fields)]

    @staticmethod
    def _velocity(fields: Fields, full: bool) -> list[AnyReading]:
        if not fields.get("vel_ned_valid", True):
            return []
        sigma = _positive(fields.get("s_variance_m_s"))  # a sigma, for all its name
        down = fields["vel_d_m_s"] if full else None
        return [Velocity(fields["vel_n_m_s"], fields["vel_e_m_s"], down, sigma)]

    @staticmethod
    def _heading(fields: Fields) -> list[AnyReading]:
        heading = fields.get("heading", math.nan)
        if not math.isfinite(heading):
            return []
        return [Heading(math.remainder(heading, math.tau), _positive(fields.get("heading_accuracy")))]


class _LocalOrigin:
    """vehicle_local_position: where PX4's own origin lies, said once and whenever it moves."""

    def __init__(self) -> None:
        self._last = (math.nan, math.nan, math.nan)

    def __call__(self, fields: Fields, _notes: Notes) -> list[AnyReading]:
        place = (fields["ref_lat"], fields["ref_lon"], fields["ref_alt"])
        if not fields.get("xy_global", False) or place == self._last or not all(map(math.isfinite, place)):
            return []
        self._last = place
        return [Origin(place[0] * DEGREE, place[1] * DEGREE, place[2])]


BLENDED, RAW = "vehicle_gps_position", "sensor_gps"


def handlers() -> dict[str, Handler]:
    """Return new handlers by topic."""
    return {
        "sensor_combined": sensor_combined,
        "vehicle_magnetometer": vehicle_magnetometer,
        "vehicle_air_data": vehicle_air_data,
        "sensor_baro": sensor_baro,
        "vehicle_attitude": vehicle_attitude,
        "distance_sensor": distance_sensor,
        "wheel_encoders": wheel_encoders,
        "rpm": rpm,
        "ranging_beacon": ranging_beacon,
        BLENDED: _Receiver(BLENDED),
        RAW: _Receiver(RAW),
        "vehicle_local_position": _LocalOrigin(),
    }
