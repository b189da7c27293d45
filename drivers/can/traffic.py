"""What passes by on a bus, whether wanted or not: a count of messages by kind, for a report."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any, Protocol, cast

import dronecan

from drivers.can.frame import CanFrame

_SERVICE = 0x80
_START = 0x80


_MOST_IDENTIFIERS = 4096


class Census(Protocol):
    """Counts what passes by on a bus."""

    def count(self, frame: CanFrame) -> None:
        """Take note of one frame."""
        ...

    def kinds(self) -> dict[str, int]:
        """Return the counts by name."""
        ...


class IdentifierTraffic:
    """Counts frames by identifier, under the names of a DBC file where it has one.

    Memory is bounded: a bus with more than 4,096 identifiers has its further ones counted as ``others``.

    Parameters
    ----------
    names : Mapping[tuple[bool, int], str]
        By (extended, identifier).
    """

    def __init__(self, names: Mapping[tuple[bool, int], str]) -> None:
        self._names = names
        self._counts: Counter[tuple[bool, int]] = Counter()
        self._others = 0

    def count(self, frame: CanFrame) -> None:
        """Take note of one frame."""
        key = (frame.extended, frame.identifier)
        if key in self._counts or len(self._counts) < _MOST_IDENTIFIERS:
            self._counts[key] += 1
        else:
            self._others += 1

    def kinds(self) -> dict[str, int]:
        """Return the counts by name: ``WHEEL_SPEEDS``, ``0x0B4``, ``0x18FEF100``, ``others``."""
        counts = {
            self._names.get(key, f"0x{key[1]:08X}" if key[0] else f"0x{key[1]:03X}"): count
            for key, count in self._counts.items()
        }
        return counts | ({"others": self._others} if self._others else {})


class Traffic:
    """Counts transfers by their DroneCAN type, and frames with 11-bit identifiers by those.

    Memory is bounded by the numbers that there are: 65,536 message types, 256 services, 2,048 identifiers.
    """

    def __init__(self) -> None:
        self._messages: Counter[int] = Counter()
        self._services: Counter[int] = Counter()
        self._standard: Counter[int] = Counter()

    def count(self, frame: CanFrame) -> None:
        """Take note of one frame; of a transfer only the first counts."""
        if not frame.extended:
            self._standard[frame.identifier] += 1
        elif frame.data and frame.data[-1] & _START:
            if frame.identifier & _SERVICE:
                self._services[frame.identifier >> 16 & 0xFF] += 1
            else:
                self._messages[frame.identifier >> 8 & 0xFFFF] += 1

    def kinds(self) -> dict[str, int]:
        """Return the counts by name: ``gnss.Fix2``, ``protocol.NodeStatus``, ``message 20999``, ``0x0B4``."""
        counts: dict[str, int] = {}
        for number, count in self._messages.items():
            counts[_name("message", number)] = count
        for number, count in self._services.items():
            counts[_name("service", number)] = count
        for identifier, count in self._standard.items():
            counts[f"0x{identifier:03X}"] = count
        return counts


def _name(sort: str, number: int) -> str:
    types = cast("dict[tuple[int, int], Any]", dronecan.DATATYPES)
    compound = cast("Any", dronecan.dsdl).CompoundType
    kind = compound.KIND_SERVICE if sort == "service" else compound.KIND_MESSAGE
    known = types.get((number, kind))
    if known is None:
        return f"{sort} {number}"
    return str(known.full_name).removeprefix("uavcan.").removeprefix("equipment.")
