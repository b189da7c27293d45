"""DataFlash logs written by hand: FMT, FMTU, UNIT and MULT, and messages packed by their formats."""

from __future__ import annotations

import struct

CODES = {
    "a": "64s", "b": "b", "B": "B", "h": "h", "H": "H", "i": "i", "I": "I", "f": "f", "d": "d", "n": "4s", "N": "16s",
    "Z": "64s", "c": "h", "C": "H", "e": "i", "E": "I", "L": "i", "M": "B", "q": "q", "Q": "Q",
}  # fmt: skip

KINDS: dict[str, tuple[int, str, str]] = {
    "FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns"),
    "FMTU": (129, "QBNN", "TimeUS,FmtType,UnitIds,MultIds"),
    "UNIT": (130, "QbZ", "TimeUS,Id,Label"),
    "MULT": (131, "Qbd", "TimeUS,Id,Mult"),
    "IMU": (140, "QBffffffIIfBBHH", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz"),
    "GPS": (141, "QBBIHBcLLeffffB", "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U"),
    "GPA": (142, "QBCCCCfBIH", "TimeUS,I,VDop,HAcc,VAcc,SAcc,YAcc,VV,SMS,Delta"),
    "BCN": (143, "QBBfffffff", "TimeUS,Health,Cnt,D0,D1,D2,D3,PosX,PosY,PosZ"),
    "WENC": (144, "Qfbfb", "TimeUS,Dist0,Qual0,Dist1,Qual1"),
    "RFND": (145, "QBCBBb", "TimeUS,Instance,Dist,Stat,Orient,Quality"),
    "MAG": (146, "QBhhhB", "TimeUS,I,MagX,MagY,MagZ,Health"),
    "BARO": (147, "QBffcfB", "TimeUS,I,Alt,Press,Temp,CRt,H"),
    "ATT": (148, "QccccCC", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw"),
    "ORGN": (149, "QBLLe", "TimeUS,Type,Lat,Lng,Alt"),
    "POS": (150, "QLLfff", "TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt"),
    "RPM": (151, "Qff", "TimeUS,rpm1,rpm2"),
}


def message(name: str, *values: object) -> bytes:
    kind, form, _ = KINDS[name]
    packed = struct.pack("<" + "".join(CODES[c] for c in form), *values)
    return b"\xa3\x95" + bytes([kind]) + packed


def definition(name: str) -> bytes:
    kind, form, columns = KINDS[name]
    length = 3 + struct.calcsize("<" + "".join(CODES[c] for c in form))
    return message("FMT", kind, length, name.encode(), form.encode(), columns.encode())


def definitions(*names: str) -> bytes:
    return b"".join(definition(name) for name in names or KINDS)


def imu(at: int, *gyro: float, unit: int = 0) -> bytes:
    x, y, z = gyro or (0.1, 0.2, 0.3)
    return message("IMU", at, unit, x, y, z, 1.0, 2.0, -9.8, 0, 0, 40.0, 1, 1, 1000, 1000)


def gps(
    at: int, week_ms: int, *, status: int = 3, lat: int = 521_712_489, week: int = 2300, unit: int = 0
) -> bytes:
    return message(
        "GPS", at, unit, status, week_ms, week, 9, 110, lat, 44_104_949, 1_250, 2.0, 90.0, -0.5, 0.0, 1
    )  # fmt: skip
