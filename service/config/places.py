"""A place in the configuration, as the file shows it: ``link "bus" (link 2), signal 3, scale``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import cast

Place = tuple[int | str, ...]


def _table(value: object) -> Mapping[str, object]:
    return cast("Mapping[str, object]", value) if isinstance(value, Mapping) else {}


def _array(value: object) -> Sequence[object]:
    return cast("Sequence[object]", value) if isinstance(value, list | tuple) else ()


def _entry(table: str, index: int, entry: Mapping[str, object]) -> str:
    """Name one entry of an array of tables: beacons by number, links by name, the rest by kind."""
    identity, name, kind = entry.get("id"), entry.get("name"), entry.get("kind")
    if table == "beacon" and isinstance(identity, int) and not isinstance(identity, bool):
        return f"beacon {identity}"
    if table == "link" and isinstance(name, str) and name:
        return f'link "{name}" (link {index + 1})'
    if table == "sensor" and isinstance(kind, str) and kind:
        return f"sensor {index + 1} ({kind})"
    return f"{table} {index + 1}"


def _without_tag(place: Place, raw: object) -> Place:
    """Drop the tag by which the validator chose among the kinds of link: it is no key of the file."""
    if len(place) < 3 or place[0] != "link" or not isinstance(place[1], int):
        return place
    links = _array(_table(raw).get("link"))
    kind = _table(links[place[1]]).get("kind") if place[1] < len(links) else None
    return (*place[:2], *place[3:]) if kind == place[2] else place


def place_in_words(place: Place, raw: object) -> str:
    """Return a place (keys, and indices from 0) in the content ``raw`` of a file in words."""
    words: list[str] = []
    current: object = raw
    array = ""
    for step in _without_tag(place, raw):
        if isinstance(step, str):
            words.append(step)
            current = _table(current).get(step)
            array = step
            continue
        items = _array(current)
        current = items[step] if step < len(items) else None
        if array in ("link", "sensor", "beacon", "signal", "servo"):
            words[-1] = _entry(array, step, _table(current))
        else:
            words.append(f"number {step + 1}")
    return ", ".join(words)
