"""The map of landmarks beside the sensors that see them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, cast

from service.config.places import place_in_words

Table = Mapping[str, Any]
SIGHTS = ("bearing", "range_bearing")


def wrong_landmarks(raw: Table) -> Iterator[str]:
    """Return every sensor that sees landmarks and has no map of them, and what is wrong with the map.

    Parameters
    ----------
    raw : Mapping
        The file's content, its paths resolved; what is not of its type is left to the sections.
    """
    path = _landmarks(raw)
    if path is None:
        for index, sensor in enumerate(_sensors(raw)):
            if sensor.get("kind") in SIGHTS:
                where = place_in_words(("sensor", index, "kind"), raw)
                yield f"{where}: needs [map] landmarks, a CSV file of where they stand"
    elif "\0" not in path and Path(path).is_file():
        from drivers.maps.landmarks import LandmarkError, read  # few configurations have a map

        try:
            read(Path(path))
        except LandmarkError as error:
            yield f"map, landmarks: {error}"


def _landmarks(raw: Table) -> str | None:
    table = raw.get("map")
    path = cast("Table", table).get("landmarks") if isinstance(table, Mapping) else None
    return path if isinstance(path, str) and path else None


def _sensors(raw: Table) -> Iterator[Table]:
    sensors = raw.get("sensor")
    for sensor in cast("list[object]", sensors) if isinstance(sensors, list) else []:
        yield cast("Table", sensor) if isinstance(sensor, Mapping) else {}
