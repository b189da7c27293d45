"""What no section can see alone: names that must be elsewhere in the file, files that must be on the disk.

These checks read the file as it came, so that they speak in the same breath as the errors of its sections.
They say nothing about what is not of the expected type: the sections do.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, cast

from service.config.complaints import did_you_mean
from service.config.landmarks import wrong_landmarks
from service.config.places import place_in_words
from service.config.section import shown
from service.config.signals import wrong_signals

Table = Mapping[str, Any]

# What the file may say already and this version does not do yet; the words say what it does.
NOT_BUILT: dict[tuple[str, str], tuple[frozenset[object], str]] = {
    ("vehicle", "motion"): (frozenset({"drift", "inertial"}), "constant_velocity, unicycle"),
    ("sensor", "kind"): (
        frozenset({"terrain", "scan"}),
        "position, velocity, range, bearing, range_bearing, heading, altitude, speed",
    ),
    ("link", "send"): (frozenset({"odometry", "gps_input", "global_position_sensor"}), "none"),
}
NOT_READ = (("map", "terrain"), ("map", "occupancy"), ("publish", "ros2_domain"))
_NOTHING: tuple[object, ...] = ("", -1)

_POINTING = frozenset({"heading", "bearing", "range_bearing"})
"""Kinds of measurement that a heading belongs to."""

FILES = (("link", "signing_key_file"), ("link", "dbc"), ("publish", "zenoh"), ("map", "landmarks"))
"""Keys that name files; relative ones are relative to the configuration's folder."""


def table(raw: Table, name: str) -> Table:
    """Return a table of the file, empty where there is none or it is something else."""
    value = raw.get(name)
    return cast("Table", value) if isinstance(value, Mapping) else {}


def entries(raw: Table, name: str) -> Iterator[tuple[tuple[int | str, ...], Table]]:
    """Return the tables under a name with their places: one for ``[map]``, each for ``[[link]]``."""
    value = raw.get(name)
    if isinstance(value, Mapping):
        yield (name,), cast("Table", value)
    elif isinstance(value, list):
        for index, entry in enumerate(cast("list[object]", value)):
            if isinstance(entry, Mapping):
                yield (name, index), cast("Table", entry)


def _repeated(raw: Table, name: str, key: str) -> Iterator[str]:
    first: dict[object, int] = {}
    for place, entry in entries(raw, name):
        value, index = entry.get(key), int(place[1]) if len(place) > 1 else 0
        if not isinstance(value, str | int):
            continue
        if value in first:
            where = place_in_words((*place, key), raw)
            taken = f"{shown(value)} is taken by {name} {first[value] + 1}"
            yield f"{where}: {taken}; each {name} needs its own {key}"
        first.setdefault(value, index)


def _unknown_links(raw: Table) -> Iterator[str]:
    links = raw.get("link")
    names = [link["name"] for _, link in entries(raw, "link") if isinstance(link.get("name"), str)]
    # none: a site, its recording has the links; some without a name: it may be meant, and is an error already
    if not isinstance(links, list) or not links or len(names) < len(cast("list[object]", links)):
        return
    for place, sensor in entries(raw, "sensor"):
        link = sensor.get("link")
        if isinstance(link, str) and link not in names:
            where = place_in_words((*place, "link"), raw)
            yield f"{where}: no link {shown(link)}, there is {', '.join(names)}{did_you_mean(link, names)}"


def _unknown_beacons(raw: Table) -> Iterator[str]:
    known = [beacon.get("id") for _, beacon in entries(raw, "beacon")]
    for place, sensor in entries(raw, "sensor"):
        wanted = sensor.get("beacons")
        for beacon in cast("list[object]", wanted) if isinstance(wanted, list) else []:
            if isinstance(beacon, int) and beacon not in known:
                yield f"{place_in_words((*place, 'beacons'), raw)}: no [[beacon]] with id {beacon}"


def _area_of_a_global_start(raw: Table) -> Iterator[str]:
    if table(raw, "start").get("mode") == "global" and "area" not in raw:
        yield 'area: is missing; start, mode = "global" needs [area] with north and east'


def _budget_within_a_tick(raw: Table) -> Iterator[str]:
    rate, spent = table(raw, "loop").get("rate", 50.0), table(raw, "budget").get("cpu_ms", 4.0)
    if not isinstance(rate, int | float) or not isinstance(spent, int | float):
        return
    if 0 < rate <= 1000 and spent > 1000 / rate:
        tick = f"{1000 / rate:g} ms at loop, rate = {rate:g}"
        yield f"budget, cpu_ms: needs at most one tick ({tick}), got {shown(spent)}"


def _not_built(raw: Table) -> Iterator[str]:
    for (name, key), (planned, built) in NOT_BUILT.items():
        for place, entry in entries(raw, name):
            value = entry.get(key)
            for one in cast("list[object]", value) if isinstance(value, list) else [value]:
                if isinstance(one, str) and one in planned:
                    where = place_in_words((*place, key), raw)
                    yield f"{where}: {shown(one)} is not in this version, which has: {built}"
    for name, key in NOT_READ:
        value = table(raw, name).get(key, "")
        if isinstance(value, str | int) and value not in _NOTHING:
            yield f"{name}, {key}: is not in this version; leave it out"


_SLOW_STATES: dict[str, tuple[str, ...]] = {
    "range": ("scale", "bias"),
    "position": ("delay",),
    "velocity": ("delay",),
    "speed": ("scale", "bias"),
    "altitude": ("bias",),
}
_OWNERS = {
    "scale": "ranges and speeds",
    "bias": "ranges, speeds and altitudes",
    "delay": "positions and velocities",
}


def _slow_states_of_others(raw: Table) -> Iterator[str]:
    for place, sensor in entries(raw, "sensor"):
        kind, wanted = sensor.get("kind"), sensor.get("estimate")
        if not isinstance(kind, str) or not isinstance(wanted, list):
            continue
        for state in cast("list[object]", wanted):
            if isinstance(state, str) and state in _OWNERS and state not in _SLOW_STATES.get(kind, ()):
                where = place_in_words((*place, "estimate"), raw)
                yield f"{where}: {state} is estimated for {_OWNERS[state]} only, and this is {shown(kind)}"


def _headings_of_tags(raw: Table) -> Iterator[str]:
    if table(raw, "vehicle").get("motion") != "constant_velocity":
        return
    for place, sensor in entries(raw, "sensor"):
        kind = sensor.get("kind")
        if kind in _POINTING:
            where = place_in_words((*place, "kind"), raw)
            yield f'{where}: {shown(kind)} needs a heading, which motion = "constant_velocity" has not; leave it out'


def _wheels_of_others(raw: Table) -> Iterator[str]:
    """Say where facts of a speed stand beside another kind, or beside a vehicle that they say nothing of."""
    free = table(raw, "vehicle").get("motion") == "constant_velocity"
    speeds = 0
    for place, sensor in entries(raw, "sensor"):
        kind = sensor.get("kind")
        speeds += kind == "speed"
        for key in ("lever", "index"):
            if key in sensor and isinstance(kind, str) and kind != "speed":
                yield f'{place_in_words((*place, key), raw)}: belongs to kind = "speed", and this is {shown(kind)}'
        if free and kind == "speed" and "lever" in sensor:
            where = place_in_words((*place, "lever"), raw)
            yield f'{where}: needs a heading, which motion = "constant_velocity" has not; leave it out'
    if table(raw, "motion").get("speed_from") == "sensors" and not speeds:
        yield 'motion, speed_from: "sensors" needs at least one [[sensor]] of kind = "speed"'


def _slow_states_only_once(raw: Table) -> Iterator[str]:
    first: dict[str, int] = {}
    for index, (place, sensor) in enumerate(entries(raw, "sensor"), 1):
        wanted = sensor.get("estimate")
        if sensor.get("kind") != "range" or not isinstance(wanted, list):
            continue
        for state in cast("list[object]", wanted):
            if isinstance(state, str) and first.setdefault(state, index) != index:
                where = place_in_words((*place, "estimate"), raw)
                yield f"{where}: {shown(state)} is estimated with sensor {first[state]}; there is one of all ranges"


def resolved(raw: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return the file's content with the paths it names taken relative to the file's folder."""
    named = {key for _, key in FILES}

    def absolute(entry: Any) -> Any:
        if not isinstance(entry, dict):
            return entry
        facts = cast("dict[str, Any]", entry)
        return {
            key: str(folder / value) if key in named and isinstance(value, str) and value else value
            for key, value in facts.items()
        }

    content = dict(raw)
    for name in {name for name, _ in FILES}:
        value = content.get(name)
        content[name] = (
            [absolute(entry) for entry in cast("list[Any]", value)] if isinstance(value, list) else value
        )
        if isinstance(value, dict):
            content[name] = absolute(value)
        elif value is None:
            content.pop(name, None)
    return content


def _absent_files(raw: Table) -> Iterator[str]:
    for name, key in FILES:
        for place, entry in entries(raw, name):
            path = entry.get(key)
            if isinstance(path, str) and path and "\0" not in path and not Path(path).is_file():
                yield f"{place_in_words((*place, key), raw)}: needs a file that exists, there is no {path}"


def across_sections(raw: Table) -> list[str]:
    """Return every error that lies between sections, or between the file and the disk."""
    return [
        *_repeated(raw, "link", "name"),
        *_repeated(raw, "beacon", "id"),
        *_unknown_links(raw),
        *_unknown_beacons(raw),
        *_area_of_a_global_start(raw),
        *_budget_within_a_tick(raw),
        *_not_built(raw),
        *_headings_of_tags(raw),
        *_slow_states_of_others(raw),
        *_slow_states_only_once(raw),
        *_wheels_of_others(raw),
        *_absent_files(raw),
        *wrong_landmarks(raw),
        *wrong_signals(entries(raw, "link"), raw),
    ]
