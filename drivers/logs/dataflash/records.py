"""What the messages of a DataFlash log say, as readings: one small handler for each.

Fields come in SI units (:mod:`drivers.logs.dataflash.layout`); a field that a firmware does not log is absent. Units
beyond the first of a kind see the same motion: used beside it they would count twice. The autopilot's own estimates
(POS, XKF1, AHR2, …) are no sensors and are left alone; of XKF0 only where the beacons stand is taken.
"""

from __future__ import annotations

import math

from drivers.logs.dataflash.layout import DEGREE
from drivers.logs.onboard import Fields, Handler, Notes
from drivers.mavlink.inertial import KELVIN, LARGEST_FIELD, LARGEST_FORCE, LARGEST_RATE
from drivers.sample import (
    AnyReading,
    Attitude,
    BeaconPlace,
    Clearance,
    GeodeticPosition,
    Heading,
    Inertial,
    MotorSpeed,
    Odometer,
    Origin,
    Pressure,
    Range,
    Vector,
    Velocity,
)

USUAL: dict[str, dict[str, float]] = {
    "ATT": {"Roll": DEGREE, "Pitch": DEGREE, "Yaw": DEGREE},
    "MAG": {"MagX": 1e-7, "MagY": 1e-7, "MagZ": 1e-7},  # milligauss
    "GPS": {"Lat": DEGREE, "Lng": DEGREE, "GCrs": DEGREE, "Yaw": DEGREE, "GMS": 1e-3},
    "GPS2": {"Lat": DEGREE, "Lng": DEGREE, "GCrs": DEGREE, "Yaw": DEGREE, "GMS": 1e-3},
    "GPA": {"YAcc": DEGREE},
    "GPA2": {"YAcc": DEGREE},
    "ORGN": {"Lat": DEGREE, "Lng": DEGREE},
    "RPM": {"rpm1": math.tau / 60.0, "rpm2": math.tau / 60.0},
}
"""Units, as factors to SI, of the columns of logs that do not say them."""

FIX_2D, FIX_3D = 2, 3
GOOD = 4  # RangeFinder::Status
EKF_ORIGIN = 0
MOST_BEACONS = 4
DOWN = 25


def _vector(fields: Fields, names: str, largest: float) -> Vector | None:
    """Return the vector of three columns, ``None`` where it is not finite or longer than it can be."""
    x, y, z = (fields[name] for name in names.split())
    return (x, y, z) if math.sqrt(x * x + y * y + z * z) <= largest else None


def _imu(fields: Fields, notes: Notes) -> list[AnyReading]:
    """IMU: gyro and accelerometer, each with its health (GH, AH)."""
    rate = force = None
    if fields.get("GH", 1.0):
        rate = _vector(fields, "GyrX GyrY GyrZ", LARGEST_RATE)
        notes.malformed["IMU.Gyr"] += rate is None
    else:
        notes.unusable["IMU.GH"] += 1
    if fields.get("AH", 1.0):
        force = _vector(fields, "AccX AccY AccZ", LARGEST_FORCE)
        notes.malformed["IMU.Acc"] += force is None
    else:
        notes.unusable["IMU.AH"] += 1
    return [] if rate is None and force is None else [Inertial(rate, force)]


def _mag(fields: Fields, notes: Notes) -> list[AnyReading]:
    """MAG: the field with its offsets taken out."""
    if not fields.get("Health", 1.0):
        notes.unusable["MAG.Health"] += 1
        return []
    field = _vector(fields, "MagX MagY MagZ", LARGEST_FIELD)
    if field is None:
        notes.malformed["MAG.Mag"] += 1
        return []
    return [Inertial(magnetic_field=field)]


def _baro(fields: Fields, notes: Notes) -> list[AnyReading]:
    """BARO: pressure and temperature; Alt is above wherever the vehicle was armed, and is not used."""
    if not fields.get("H", fields.get("Health", 1.0)):
        notes.unusable["BARO.Health"] += 1
        return []
    temperature = fields["Temp"] + KELVIN if "Temp" in fields else None
    return [Pressure(fields["Press"], temperature=temperature)]


def _att(fields: Fields, _notes: Notes) -> list[AnyReading]:
    """ATT: the autopilot's attitude."""
    return [Attitude(fields["Roll"], fields["Pitch"], fields["Yaw"])]


def _orgn(fields: Fields, notes: Notes) -> list[AnyReading]:
    """ORGN: the origin of the autopilot's filter; home (type 1) is another place."""
    if fields["Type"] != EKF_ORIGIN:
        notes.unusable["ORGN.Type"] += 1
        return []
    return [Origin(fields["Lat"], fields["Lng"], fields["Alt"])]


class _Beacons:
    """BCN: the latest distance to each of up to four beacons, repeated until there is a new one."""

    def __init__(self) -> None:
        self._last: dict[int, float] = {}

    def __call__(self, fields: Fields, notes: Notes) -> list[AnyReading]:
        readings: list[AnyReading] = []
        for beacon in range(min(MOST_BEACONS, int(fields["Cnt"]))):
            name = f"D{beacon}"
            distance = fields.get(name, 0.0)
            if distance == 0.0 or distance == self._last.get(beacon):
                notes.unusable[f"BCN.{name}"] += 1
                continue
            self._last[beacon] = distance
            readings.append(Range(beacon, distance))
        return readings


class _Surveyed:
    """NKF0, XKF0: the beacon that the autopilot's filter looks at, with its place by its own survey.

    North and east are the survey's; down has a shift in it that the filter estimates anew all the time and that all
    beacons share. So each beacon is told once, as it was first logged: the differences of their heights are right.
    """

    def __init__(self) -> None:
        self._told: set[int] = set()

    def __call__(self, fields: Fields, _notes: Notes) -> list[AnyReading]:
        beacon = int(fields["ID"])
        if beacon in self._told:
            return []
        place = BeaconPlace(beacon, fields["BPN"], fields["BPE"], fields["BPD"])
        self._told.add(beacon)
        return [place]


class _Receiver:
    """GPS of one receiver; what it says of its accuracy comes in the GPA beside it.

    In an outage the last fix is logged on with its old time.
    """

    def __init__(self) -> None:
        self._accuracy: Fields = {}
        self._last = (-1.0, -1.0)

    def accuracy(self, fields: Fields, _notes: Notes) -> list[AnyReading]:
        """GPA: kept for the next fix."""
        self._accuracy = dict(fields)
        return []

    def fix(self, fields: Fields, notes: Notes) -> list[AnyReading]:
        """GPS: position, velocity, and heading of a receiver with two antennas."""
        if fields["Status"] < FIX_2D:
            notes.unusable["GPS.Status"] += 1
            return []
        moment = (fields["GWk"], fields["GMS"])
        if moment == self._last:
            notes.unusable["GPS.GMS"] += 1
            return []
        self._last = moment
        if fields["Lat"] == 0.0 and fields["Lng"] == 0.0:
            notes.malformed["GPS.Lat"] += 1
            return []
        full = fields["Status"] >= FIX_3D
        position = GeodeticPosition(
            fields["Lat"],
            fields["Lng"],
            fields["Alt"] if full else None,
            self._sigma("HAcc"),
            self._sigma("VAcc") if full else None,
            int(fields["NSats"]) if "NSats" in fields else None,
        )
        speed, course = fields["Spd"], fields["GCrs"]
        down = fields.get("VZ") if full else None
        velocity = Velocity(speed * math.cos(course), speed * math.sin(course), down, self._sigma("SAcc"))
        yaw = fields.get("Yaw", 0.0)
        heading = [] if yaw == 0.0 else [Heading(math.remainder(yaw, math.tau), self._sigma("YAcc"))]
        return [position, velocity, *heading]

    def _sigma(self, name: str) -> float | None:
        return self._accuracy.get(name) or None  # 0: not known


class _Wheels:
    """WENC: cumulative distances; an encoder that is not fitted stays at 0 with quality 0."""

    def __init__(self) -> None:
        self._fitted = [False, False]
        self._epoch = 0
        self._last: tuple[float, ...] = ()

    def __call__(self, fields: Fields, notes: Notes) -> list[AnyReading]:
        before = sum(self._fitted)
        for wheel in range(2):
            self._fitted[wheel] |= bool(fields[f"Dist{wheel}"] or fields[f"Qual{wheel}"])
        if not any(self._fitted):
            notes.unusable["WENC.Qual"] += 1
            return []
        distances = tuple(fields[f"Dist{wheel}"] for wheel in range(2) if self._fitted[wheel])
        self._epoch += 0 < before < len(distances)
        return [Odometer(distances, self._epoch)]


def _rfnd(fields: Fields, notes: Notes) -> list[AnyReading]:
    """RFND: one range finder a message, with its state; before 2018 two of them, 0 for none."""
    if "Dist" in fields:
        if fields.get("Stat", GOOD) != GOOD:
            notes.unusable["RFND.Stat"] += 1
            return []
        return [Clearance(fields["Dist"], int(fields.get("Orient", DOWN)))]
    readings: list[AnyReading] = []
    for number in ("1", "2"):
        distance = fields.get(f"Dist{number}", 0.0)
        if distance > 0.0 and fields.get(f"Stat{number}", GOOD) == GOOD:
            readings.append(Clearance(distance, int(fields.get(f"Orient{number}", DOWN))))
        else:
            notes.unusable[f"RFND.Dist{number}"] += 1
    return readings


class _Tachometers:
    """RPM: two sensors; ArduPilot logs 0, or -1, for one that is not fitted."""

    def __init__(self) -> None:
        self._turned = [False, False]

    def __call__(self, fields: Fields, notes: Notes) -> list[AnyReading]:
        readings: list[AnyReading] = []
        for index, name in enumerate(("rpm1", "rpm2")):
            speed = fields.get(name, 0.0)
            self._turned[index] |= speed > 0.0
            if self._turned[index]:
                readings.append(MotorSpeed(index, speed))
            else:
                notes.unusable[f"RPM.{name}"] += 1
        return readings


def handlers() -> dict[str, Handler]:
    """Return new handlers, by source: the message's name, and for the second receiver ``GPS2``."""
    first, second = _Receiver(), _Receiver()
    return {
        "IMU": _imu,
        "MAG": _mag,
        "BARO": _baro,
        "ATT": _att,
        "ORGN": _orgn,
        "BCN": _Beacons(),
        "NKF0": _Surveyed(),
        "XKF0": _Surveyed(),
        "GPS": first.fix,
        "GPA": first.accuracy,
        "GPS2": second.fix,
        "GPA2": second.accuracy,
        "WENC": _Wheels(),
        "RFND": _rfnd,
        "RPM": _Tachometers(),
    }


def source_of(name: str, fields: Fields) -> str | None:
    """Return which handler a message is for, ``None`` for a unit beyond those that are used."""
    unit = int(fields.get("I", fields.get("Instance", 0.0)))
    if unit == 0 or name == "RFND":
        return name
    return f"{name}2" if name in ("GPS", "GPA") and unit == 1 else None
