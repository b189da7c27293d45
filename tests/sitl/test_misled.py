"""The rover's telemetry, its receiver misled afterwards: the fixes of a stretch are moved, all else is as recorded.

Nothing here is caught as a jump would be: the fixes go away slowly, stay near, or stand still. They still claim 0.3 m.
Bounds leave a third or more to what was measured over seeds; when the belief followed such fixes, it was 20 to 30 m off
and said 0.3 m.
"""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import all as dialect

from service.replay import Plan, Run, replay
from service.replay.site import setting_of
from service.score import read_truth

from .trim import STAMP, entries

ROVER = Path(__file__).parent / "data" / "sitl_rover.tlog"
PARTICLES = 1000
BEGIN, END = 100.0, 160.0
EARTH = 6_378_137.0

Shift = Callable[[float], tuple[float, float]]


def creeping(elapsed: float) -> tuple[float, float]:
    """0.2 m/s, straight."""
    return 0.12 * elapsed, 0.16 * elapsed


def circling(elapsed: float) -> tuple[float, float]:
    """Once in 20 s about a point 10 m beside the truth."""
    angle = 2.0 * math.pi * elapsed / 20.0
    return 10.0 * math.sin(angle), 10.0 * (1.0 - math.cos(angle))


def misled(path: Path, shift: Shift | None) -> Path:
    """Write the rover's log with its fixes moved by ``shift``; where that is ``None`` the last honest one stays."""
    wire = dialect.MAVLink(None)
    kept: list[bytes] = []
    first, honest = 0.0, (0, 0)
    for kind, entry in entries(ROVER.read_bytes()):
        time = int.from_bytes(entry[:STAMP], "big") * 1e-6
        first = first or time
        if kind == "GPS_RAW_INT":
            fix = wire.decode(bytearray(entry[STAMP:]))
            if BEGIN <= time - first < END:
                if shift is None:
                    fix.lat, fix.lon = honest
                else:
                    north, east = shift(time - first - BEGIN)
                    fix.lat += round(math.degrees(north / EARTH) * 1e7)
                    fix.lon += round(
                        math.degrees(east / (EARTH * math.cos(math.radians(fix.lat * 1e-7)))) * 1e7
                    )
            else:
                honest = fix.lat, fix.lon
            sender = dialect.MAVLink(None, fix.get_srcSystem(), fix.get_srcComponent())
            sender.seq = fix.get_seq()
            kept.append(entry[:STAMP] + bytes(fix.pack(sender)))
        else:
            kept.append(entry)
    path.write_bytes(b"".join(kept))
    for ending in (".toml", "_truth.csv"):
        shutil.copyfile(ROVER.with_name(ROVER.stem + ending), path.with_name(path.stem + ending))
    return path


def run_of(log: Path) -> Run:
    setting = setting_of((log,), None, log.with_name(log.stem + "_truth.csv"))
    assert setting.truth is not None
    return replay(Plan((log,), setting.configuration, PARTICLES, read_truth(setting.truth), None), 0)


@pytest.mark.parametrize(
    ("shift", "most"),
    [(creeping, 7.0), (circling, 12.0), (None, 10.0)],
    ids=["creeping", "circling", "standing"],
)
def test_a_misled_receiver_is_not_followed_and_the_region_says_so(
    shift: Shift | None, most: float, tmp_path: Path
) -> None:
    score = run_of(misled(tmp_path / "misled.tlog", shift)).score
    assert score.max_m is not None
    assert score.max_m <= most
    assert score.coverage_95 is not None
    assert score.coverage_95 >= 0.85
    assert score.final_m is not None
    assert score.final_m <= 2.0
