"""What others parsed of the recorded car's minute, as files for a replay: GNSS as a .tlog, truth as CSV."""

from __future__ import annotations

import math
import struct
from pathlib import Path
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

CONFIGURATION = """
[vehicle]
name = "car"
[origin]
latitude = {latitude}
longitude = {longitude}
altitude = {altitude}
[motion]
yaw_rate_noise = 0.001            # a car on tyres does not skid; its sensor counts quarters of a degree per second
slip_noise = 0.02
gyro_bias_sigma = 0.01
[[link]]
name = "bus"
kind = "can"
channel = "can0"
protocol = "dbc"
dbc = "{dbc}"
[[link.signal]]
signal = "WHEEL_SPEEDS.WHEEL_SPEED_FL"
measures = "wheel_speed"
index = 0
[[link.signal]]
signal = "WHEEL_SPEEDS.WHEEL_SPEED_FR"
measures = "wheel_speed"
index = 1
[[link.signal]]
signal = "WHEEL_SPEEDS.WHEEL_SPEED_RL"
measures = "wheel_speed"
index = 2
[[link.signal]]
signal = "WHEEL_SPEEDS.WHEEL_SPEED_RR"
measures = "wheel_speed"
index = 3
[[link.signal]]
signal = "KINEMATICS.YAW_RATE"
measures = "yaw_rate"
reversed = true                   # the car counts it positive to the left
[[link]]
name = "gnss"
kind = "mavlink"
url = "udpin:127.0.0.1:14550"
[[sensor]]
kind = "position"
link = "gnss"
sigma = 1.5
"""
"""Four wheels and the yaw rate by DBC, GNSS beside them."""


def configuration(folder: Path, recording: Path) -> Path:
    """Write the configuration; the origin is the truth's own."""
    latitude, longitude, altitude = recorded(recording)["origin_lla"]
    dbc = recording.with_name("toyota_2017.dbc")
    path = folder / "car.toml"
    path.write_text(CONFIGURATION.format(latitude=latitude, longitude=longitude, altitude=altitude, dbc=dbc))
    return path


def recorded(recording: Path) -> Any:
    return np.load(recording.with_name("comma2k19_seg40.npz"))


def truth(folder: Path, recording: Path) -> Path:
    """Write the reference trajectory (from GNSS, inertial unit and wheels, smoothed) as a truth file."""
    rows = recorded(recording)["ref"]
    heading = np.arctan2(rows[:, 4], rows[:, 5])
    columns = np.column_stack([rows[:, 0], rows[:, 2], rows[:, 1], -rows[:, 3], heading])
    path = folder / "truth.csv"
    np.savetxt(
        path, columns, "%.6f", delimiter=",", header="time_s,north_m,east_m,down_m,heading_rad", comments=""
    )
    return path


def gnss(folder: Path, recording: Path, blank: tuple[float, float] = (math.inf, math.inf)) -> Path:
    """Write the receiver's fixes as GPS_RAW_INT, stamped on the clock of the bus.

    ``blank``: from and to which second since the start of the reference there is none.
    """
    data = recorded(recording)
    start = data["ref"][0, 0]
    sender: Any = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    out = bytearray()
    for time, latitude, longitude, speed, _, altitude, course in data["gnss"]:
        if blank[0] <= time - start < blank[1]:
            continue
        stamp = round(time * 1e6)
        place = (round(latitude * 1e7), round(longitude * 1e7), round(altitude * 1e3))
        fix: Any = mavlink.MAVLink_gps_raw_int_message(
            stamp, 3, *place, 65535, 65535, round(speed * 100), round(course % 360 * 100) % 36_000, 10
        )
        out += struct.pack(">Q", stamp) + fix.pack(sender)
        sender.seq = (sender.seq + 1) % 256
    path = folder / "gnss.tlog"
    path.write_bytes(out)
    return path
