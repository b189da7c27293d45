"""A drive written as logs, faster than real time: what listeners would have recorded, and the truth.

``STEM.tlog``: for each MAVLink frame eight bytes of big-endian Unix microseconds of its arrival, then the
frame. ``STEM.candump.log``: one line per CAN frame, as ``candump -L`` writes them. ``STEM_truth.csv``: the
pose 50 times a second on the same clock. ``STEM.toml``: the configuration. ``STEM_events.csv``, where the
scenario has any: when what befalls the drive. The same seed gives the same bytes.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from sim_vehicle import configuration
from sim_vehicle.clock import LOG_EPOCH
from sim_vehicle.configuration import Listening
from sim_vehicle.frame import CanFrame
from sim_vehicle.scenario import Scenario
from sim_vehicle.vehicle import Vehicle
from sim_vehicle.world import Truth

TRUTH_RATE = 50
TRUTH_HEADER = "time_s,north_m,east_m,down_m,heading_rad\n"
EVENTS_HEADER = "time_s,event\n"
_CAN_INTERFACE = "can0"


@dataclass(frozen=True, slots=True)
class Recorded:
    """What was written: the files, and how many frames and rows."""

    files: tuple[Path, ...]
    mavlink_frames: int
    can_frames: int
    truth_rows: int


def truth_row(truth: Truth, unix: float) -> str:
    """Return one line of the truth: Unix seconds, metres, heading in (-pi, pi]."""
    position = f"{truth.north:.6f},{truth.east:.6f},{truth.down:.6f}"
    return f"{unix + truth.time:.6f},{position},{truth.wrapped_heading:.8f}\n"


def event_rows(scenario: Scenario, unix: float) -> str:
    """Return the table of what befalls the drive: Unix seconds and a word each."""
    return EVENTS_HEADER + "".join(f"{unix + event.time:.6f},{event.name}\n" for event in scenario.events)


def candump_line(unix_us: int, frame: CanFrame) -> str:
    """Return one line of ``candump -L``: stamp, interface, identifier # data."""
    identifier = f"{frame.identifier:08X}" if frame.extended else f"{frame.identifier:03X}"
    stamp = f"({unix_us // 1_000_000}.{unix_us % 1_000_000:06d})"
    return f"{stamp} {_CAN_INTERFACE} {identifier}#{frame.data.hex().upper()}\n"


def tlog_record(unix_us: int, frame: bytes) -> bytes:
    """Return one record of a telemetry log: the stamp, big-endian, and the frame."""
    return struct.pack(">Q", unix_us) + frame


def write(scenario: Scenario, seed: int, seconds: float, stem: Path) -> Recorded:
    """Drive ``seconds`` and write the files.

    Raises
    ------
    OSError
        A file cannot be written.
    """
    vehicle = Vehicle(scenario, seed, float(LOG_EPOCH))
    paths = [
        stem.with_name(stem.name + ending)
        for ending in (".tlog", "_truth.csv", ".toml", *((".candump.log",) if scenario.bus else ()))
    ]
    telemetry, truth, settings = paths[:3]
    stem.parent.mkdir(parents=True, exist_ok=True)
    listening = Listening(can=("socketcan", "vcan0") if scenario.bus else None)
    settings.write_text(configuration.text(scenario, listening))
    if scenario.events:
        paths.append(stem.with_name(stem.name + "_events.csv"))
        paths[-1].write_text(event_rows(scenario, float(LOG_EPOCH)))
    with telemetry.open("wb") as tlog, truth.open("w", newline="") as rows:
        if scenario.bus is None:
            counts = _drive(vehicle, seconds, tlog, rows, None)
        else:
            with paths[3].open("w", newline="") as candump:
                counts = _drive(vehicle, seconds, tlog, rows, candump)
    return Recorded(tuple(paths), *counts)


def _drive(
    vehicle: Vehicle, seconds: float, tlog: IO[bytes], rows: IO[str], candump: IO[str] | None
) -> tuple[int, int, int]:
    mavlink_frames = can_frames = truth_rows = 0

    def note(truth: Truth) -> None:
        nonlocal truth_rows
        rows.write(truth_row(truth, float(LOG_EPOCH)))
        truth_rows += 1

    rows.write(TRUTH_HEADER)
    vehicle.watch(TRUTH_RATE, note)
    for second in range(math.ceil(seconds)):
        frames = vehicle.advance(min(second + 1.0, seconds))
        tlog.writelines(tlog_record(_stamp(time), frame) for time, frame in frames.mavlink)
        if candump is not None:
            candump.writelines(candump_line(_stamp(time), frame) for time, frame in frames.can)
        mavlink_frames += len(frames.mavlink)
        can_frames += len(frames.can)
    return mavlink_frames, can_frames, truth_rows


def _stamp(time: float) -> int:
    return LOG_EPOCH * 1_000_000 + round(time * 1e6)
