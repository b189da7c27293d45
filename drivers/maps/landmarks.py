"""Landmarks from a CSV file: one a line, its number and where it stands, metres north and east of the origin.

    id,north,east
    6,0.588,-4.282

The head says the order of the columns; further columns are left alone.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from pathlib import Path

COLUMNS = ("id", "north", "east")
MOST = 10_000
"""More than this many is no map of landmarks: each reading without a name is compared with all of them."""

_FARTHEST = 1e6


class LandmarkError(ValueError):
    """The file is no map of landmarks; the text says where and what would be right."""


def read(path: Path) -> dict[int, tuple[float, float]]:
    """Return north and east (metres) of every landmark, by its number.

    Raises
    ------
    LandmarkError
        It cannot be read, or a line is wrong: the first that is.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = csv.DictReader(file)
            if not set(COLUMNS) <= set(rows.fieldnames or ()):
                head = ",".join(rows.fieldnames or ())
                raise LandmarkError(f"{path}: needs a first line id,north,east, got {head[:60] or 'nothing'}")
            return _landmarks(path, rows)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise LandmarkError(f"{path}: cannot be read: {error}") from error


def _landmarks(path: Path, rows: csv.DictReader[str]) -> dict[int, tuple[float, float]]:
    landmarks: dict[int, tuple[float, float]] = {}
    for row in rows:
        where = f"{path}, line {rows.line_num}"
        number, north, east = _numbers(where, row)
        if number in landmarks:
            raise LandmarkError(f"{where}: landmark {number} is there already; each needs its own id")
        landmarks[number] = (north, east)
        if len(landmarks) > MOST:
            raise LandmarkError(f"{where}: needs at most {MOST} landmarks")
    if not landmarks:
        raise LandmarkError(f"{path}: needs at least one landmark")
    return landmarks


def _numbers(where: str, row: Mapping[str, str | None]) -> tuple[int, float, float]:
    said = ",".join(str(row[name]) for name in COLUMNS)
    try:
        number, north, east = int(str(row["id"])), float(str(row["north"])), float(str(row["east"]))
    except ValueError:
        raise LandmarkError(
            f"{where}: needs a whole number and two numbers (id,north,east), got {said}"
        ) from None
    if number < 0 or not all(math.isfinite(value) and abs(value) <= _FARTHEST for value in (north, east)):
        raise LandmarkError(f"{where}: needs an id of 0 or more, north and east within 1000 km, got {said}")
    return number, north, east
