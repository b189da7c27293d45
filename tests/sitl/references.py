"""What recordings without an independent truth are set beside: the autopilot's own filter, the fixes it was given."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from drivers.sample import GeodeticPosition, Sample
from service.config import Configuration, MavlinkLink, Vehicle
from service.geodesy import Geodetic, LocalFrame
from service.replay.sources import open_log
from service.score import COLUMNS

ORIGIN = """\
[origin]
latitude = {latitude:.9f}
longitude = {longitude:.9f}
altitude = {altitude:.3f}
"""


def write(path: Path, rows: NDArray[np.float64]) -> Path:
    """Write a truth file: seconds, north, east, down, heading."""
    np.savetxt(path, rows, "%.6f", delimiter=",", header=",".join(COLUMNS), comments="")
    return path


def ekf3(folder: Path, recording: Path, settled: float = 0.0) -> Path:
    """Write what EKF3 made of a copter among beacons, from so many seconds after its first word, on the log's clock."""
    rows = np.load(recording.with_suffix(".npz"))["XKF1"]
    rows = rows[rows[:, 0] >= rows[0, 0] + settled]
    return write(folder / "ekf3.csv", np.column_stack([rows[:, 0], rows[:, 7:10], np.radians(rows[:, 3])]))


def fixes(folder: Path, recording: Path) -> tuple[Path, Path]:
    """Write the fixes of a telemetry log as a truth, at their own times, and the origin that they count from."""
    found = list(_fixes_of(recording))
    first = found[0][1]
    origin = Geodetic(first.latitude, first.longitude, first.altitude or 0.0)
    frame = LocalFrame(origin)
    rows = [
        (sample.time / 1e9, *frame.ned_from_geodetic(fix.latitude, fix.longitude, fix.altitude or 0.0), 0.0)
        for sample, fix in sorted(found, key=lambda pair: pair[0].time)
    ]
    facts = folder / f"{recording.stem}.toml"
    facts.write_text(
        ORIGIN.format(
            latitude=math.degrees(origin.latitude),
            longitude=math.degrees(origin.longitude),
            altitude=origin.altitude,
        )
    )
    return facts, write(folder / f"{recording.stem}_gnss.csv", np.array(rows, np.float64))


def _fixes_of(recording: Path) -> Iterator[tuple[Sample, GeodeticPosition]]:
    link = MavlinkLink(name="autopilot", kind="mavlink", url=str(recording))
    for sample in open_log(recording, Configuration(vehicle=Vehicle(name="replay"), link=(link,))):
        if isinstance(sample.reading, GeodeticPosition):
            yield sample, sample.reading


def half(folder: Path, truth: Path) -> Path:
    """Write the second half of a truth: what a belief that begins anywhere is held to."""
    rows = np.loadtxt(truth, delimiter=",", skiprows=1)
    middle = 0.5 * (rows[0, 0] + rows[-1, 0])
    return write(folder / f"{truth.stem}_second_half.csv", rows[rows[:, 0] >= middle])


def without_start(folder: Path, facts: Path) -> Path:
    """Write the facts of a place but for where the vehicle starts."""
    path = folder / f"{facts.stem}_field.toml"
    path.write_text(facts.read_text().split("[start]")[0])
    return path
