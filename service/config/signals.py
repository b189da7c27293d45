"""The signals of a configuration beside the DBC file that they are of: names, units, wheels.

The file is read only where a link has one, and the driver with it: most configurations need neither.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from service.config.complaints import did_you_mean
from service.config.links import CanLink
from service.config.places import Place, place_in_words
from service.config.section import shown

if TYPE_CHECKING:
    from drivers.can.database import Database, SignalFacts

Table = Mapping[str, Any]


def wrong_signals(links: Iterable[tuple[Place, Table]], raw: Table) -> Iterator[str]:
    """Return every signal that is not in its file or whose unit is not known, with its place.

    Parameters
    ----------
    links : Iterable of (place, table)
        The ``[[link]]`` tables as the file has them.
    raw : Mapping
        The whole content, for the places in words.
    """
    for place, link in links:
        path, signals = link.get("dbc"), link.get("signal")
        if link.get("protocol") != "dbc" or not isinstance(path, str) or not isinstance(signals, list):
            continue
        if not path or "\0" in path or not Path(path).is_file():
            continue  # said by the check of files
        from drivers.can.database import DbcError, read

        try:
            database = read(path)
        except DbcError as error:
            yield f"{place_in_words((*place, 'dbc'), raw)}: {error}"
            continue
        for index, signal in enumerate(cast("list[object]", signals)):
            if isinstance(signal, Mapping):
                for key, wrong in _faults(cast("Table", signal), database):
                    yield f"{place_in_words((*place, 'signal', index, key), raw)}: {wrong}"
        yield from _wheels_twice(cast("list[object]", signals), place, raw)


def _faults(signal: Table, database: Database) -> Iterator[tuple[str, str]]:
    """Return the key and what is wrong with it, for one signal."""
    name = signal.get("signal")
    if not isinstance(name, str) or name.count(".") != 1:
        return  # said by the section
    message_name, inner = name.split(".")
    message = database.messages.get(message_name)
    file = Path(database.path).name
    if message is None:
        yield "signal", f"no message {shown(message_name)} in {file}" + _meant(name, database)
        return
    facts = message.signals.get(inner)
    if facts is None:
        there = did_you_mean(inner, message.signals) or f"; it has {', '.join(sorted(message.signals))}"
        yield "signal", f"message {message_name} in {file} has no signal {shown(inner)}" + there
        return
    yield from _unit_not_known(signal, facts)


def _meant(name: str, database: Database) -> str:
    """Return the closest message, or the closest of all signals where only its message was forgotten or wrong."""
    return did_you_mean(name.split(".")[0], database.messages) or did_you_mean(
        name,
        [f"{message.name}.{signal}" for message in database.messages.values() for signal in message.signals],
    )


def _unit_not_known(signal: Table, facts: SignalFacts) -> Iterator[tuple[str, str]]:
    from drivers.can import units

    measures = signal.get("measures")
    if signal.get("scale") is not None or not facts.unit.strip() or measures not in units.MEASURES:
        return
    if units.factor(cast("str", measures), facts.unit) is None:
        unit = units.si_unit(cast("str", measures))
        yield (
            "scale",
            f"is missing: the DBC file gives {shown(facts.unit)}, no known unit of {measures} (to {unit})",
        )


def _wheels_twice(signals: list[object], place: Place, raw: Table) -> Iterator[str]:
    """Two wheels of one message cannot have one index."""
    first: dict[object, int] = {}
    for number, entry in enumerate(signals):
        signal = cast("Table", entry if isinstance(entry, Mapping) else {})
        name, measures, index = signal.get("signal"), signal.get("measures"), signal.get("index", 0)
        if (
            measures not in ("distance", "wheel_speed")
            or not isinstance(name, str)
            or not isinstance(index, int)
        ):
            continue
        key = (name.partition(".")[0], measures, index)
        if key in first:
            where = place_in_words((*place, "signal", number, "index"), raw)
            yield f"{where}: {index} is taken by signal {first[key] + 1}; each wheel of a message needs its own"
        first.setdefault(key, number)


def notes_on_signals(link: CanLink) -> Iterator[str]:
    """Return what is not wrong but worth knowing: scales that the file's units contradict, or that nobody said."""
    from drivers.can import units
    from drivers.can.database import read

    database = read(link.dbc)
    for signal in link.signal:
        _, facts = database.find(signal.signal)
        said = f'link "{link.name}", signal {signal.signal}'
        if signal.scale is None and not facts.unit.strip():
            yield (
                f"{said}: neither a scale nor a unit in the DBC file; taken as {units.si_unit(signal.measures)}"
            )
        if signal.scale is None:
            continue
        expected = units.contradicts(signal.measures, facts.unit, signal.scale)
        if expected is not None:
            yield (
                f'{said}: the DBC file gives "{facts.unit}", for which scale would be {expected:.6g}; '
                f"it is {signal.scale:.6g}"
            )
