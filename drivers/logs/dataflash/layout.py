"""How the messages of a DataFlash log are laid out, as the log itself says: FMT, FMTU, UNIT and MULT.

FMT gives a message's type, length, name, format characters and columns; FMTU a unit and a multiplier for each
column; UNIT and MULT what those are. So a column comes out in SI units whatever a firmware stores it as; where there
is no FMTU (before ArduPilot 3.6) the units that the column had then are assumed. Multipliers are honoured for
integers only: floating-point columns are in their unit already, whatever FMTU says (3.6 gives BCN's metres a
multiplier of 0.01).
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from typing import Protocol

HEADER = b"\xa3\x95"
HEADER_LENGTH = 3
FMT = 128
_FMT = struct.Struct("<BB4s16s64s")
_FMTU = struct.Struct("<QB16s16s")
_UNIT = struct.Struct("<Qb64s")
_MULT = struct.Struct("<Qbd")

DEGREE = math.pi / 180.0

# Format character: struct code, and the factor that it implies.
_CODES: dict[str, tuple[str, float]] = {
    "a": ("64s", 1.0), "b": ("b", 1.0), "B": ("B", 1.0), "h": ("h", 1.0), "H": ("H", 1.0), "i": ("i", 1.0),
    "I": ("I", 1.0), "f": ("f", 1.0), "d": ("d", 1.0), "n": ("4s", 1.0), "N": ("16s", 1.0), "Z": ("64s", 1.0),
    "c": ("h", 1e-2), "C": ("H", 1e-2), "e": ("i", 1e-2), "E": ("I", 1e-2), "L": ("i", 1e-7), "M": ("B", 1.0),
    "q": ("q", 1.0), "Q": ("Q", 1.0), "g": ("e", 1.0),
}  # fmt: skip

_UNITS: dict[str, float] = {
    "deg": DEGREE, "degheading": DEGREE, "deglatitude": DEGREE, "deglongitude": DEGREE, "deg/s": DEGREE,
    "rad": 1.0, "rad/s": 1.0, "m": 1.0, "m/s": 1.0, "m/s/s": 1.0, "s": 1.0, "Pa": 1.0, "degC": 1.0,
    "Gauss": 1e-4, "rpm": math.tau / 60.0,
}  # fmt: skip
"""Factors to SI (a temperature stays in degrees Celsius)."""


class Bytes(Protocol):
    """A file in memory: ``bytes`` or a map of it."""

    def __getitem__(self, key: slice, /) -> bytes: ...


def _text(content: bytes) -> str:
    return content.split(b"\0", 1)[0].decode("ascii", errors="replace")


class Layout:
    """One kind of message.

    Attributes
    ----------
    kind : int
        Its number in the log.
    name : str
        Its name.
    length : int
        Bytes, with the header.
    columns : tuple[str, ...]
        What its fields are called.
    """

    def __init__(self, kind: int, name: str, form: str, columns: tuple[str, ...]) -> None:
        codes = [_CODES[character] for character in form]
        self._struct = struct.Struct("<" + "".join(code for code, _ in codes))
        self._implied = [factor for _, factor in codes]
        self._numbers = [not code.endswith("s") for code, _ in codes]
        self._integers = [code not in ("f", "d", "e") for code, _ in codes]
        self._factors: list[tuple[str, int, float]] | None = None
        self._stamp = struct.Struct("<Q") if columns[:1] == ("TimeUS",) and form[:1] == "Q" else None
        self.kind = kind
        self.name = name
        self.length = HEADER_LENGTH + self._struct.size
        self.columns = columns

    def stamp(self, data: Bytes, at: int) -> int | None:
        """Return the microseconds since boot of the message at ``at``, ``None`` where it bears none."""
        if self._stamp is None:
            return None
        start = at + HEADER_LENGTH
        return int(self._stamp.unpack(data[start : start + 8])[0])

    def measure(self, factors: Mapping[str, float]) -> None:
        """Take the factors to SI of the columns, of raw values."""
        self._factors = [
            (column, index, factors.get(column, self._implied[index]))
            for index, column in enumerate(self.columns)
            if self._numbers[index]
        ]

    def forget(self) -> None:
        """Forget the factors: the log has said something new of its units."""
        self._factors = None

    @property
    def measured(self) -> bool:
        """Whether the factors to SI are known."""
        return self._factors is not None

    def implied(self, column: str) -> float:
        """Return the factor that the format character of a column implies."""
        return self._implied[self.columns.index(column)]

    def integer(self, column: str) -> bool:
        """Whether a column holds whole numbers."""
        return self._integers[self.columns.index(column)]

    def fields(self, data: Bytes, at: int) -> dict[str, float]:
        """Return the numbers of the message at ``at`` by column, in SI units."""
        raw = self._struct.unpack(data[at + HEADER_LENGTH : at + self.length])
        return {column: raw[index] * factor for column, index, factor in self._factors or ()}


class Layouts:
    """The kinds of message that a log has said so far.

    Parameters
    ----------
    usual : Mapping[str, Mapping[str, float]]
        By message and column: the factor to SI where the log does not say the unit, after the factor that the
        format character implies.

    Attributes
    ----------
    known : dict[int, Layout]
        By number.
    """

    def __init__(self, usual: Mapping[str, Mapping[str, float]]) -> None:
        self._usual = usual
        self._units: dict[int, str] = {}
        self._multipliers: dict[int, float] = {}
        self._said: dict[int, tuple[bytes, bytes]] = {}
        first = Layout(FMT, "FMT", "BBnNZ", ("Type", "Length", "Name", "Format", "Columns"))
        self.known: dict[int, Layout] = {FMT: first}

    def learn(self, layout: Layout, data: Bytes, at: int) -> bool:
        """Take in what a message says of the log itself; ``False`` when it cannot be true."""
        body = data[at + HEADER_LENGTH : at + layout.length]
        if layout.kind == FMT:
            return self._define(body)
        if layout.name == "FMTU" and len(body) == _FMTU.size:
            _, kind, units, multipliers = _FMTU.unpack(body)
            self._said[kind] = (units, multipliers)
        elif layout.name == "UNIT" and len(body) == _UNIT.size:
            _, identifier, label = _UNIT.unpack(body)
            self._units[identifier] = _text(label)
        elif layout.name == "MULT" and len(body) == _MULT.size:
            _, identifier, multiplier = _MULT.unpack(body)
            # a float once: its 1e-7 is 1 % of a millionth off, which is decimetres of latitude
            self._multipliers[identifier] = float(f"{multiplier:.6g}")
        else:
            return True
        for known in self.known.values():
            known.forget()
        return True

    def _define(self, body: bytes) -> bool:
        kind, length, name, form, columns = _FMT.unpack(body)
        form, names = _text(form), tuple(filter(None, _text(columns).split(",")))
        if kind == FMT:
            return True
        if not set(form) <= _CODES.keys() or len(names) != len(form):
            return False
        layout = Layout(kind, _text(name), form, names)
        if layout.length != length:
            return False
        self.known[kind] = layout
        return True

    def ready(self, layout: Layout) -> Layout:
        """Return ``layout`` with the factors of its columns known."""
        if not layout.measured:
            layout.measure({column: self._factor(layout, column) for column in layout.columns})
        return layout

    def _factor(self, layout: Layout, column: str) -> float:
        """Return the factor from the raw value of a column to SI."""
        usual = layout.implied(column) * self._usual.get(layout.name, {}).get(column, 1.0)
        units, multipliers = self._said.get(layout.kind, (b"", b""))
        index = layout.columns.index(column)
        if index >= len(units) or index >= len(multipliers):
            return usual
        unit = _UNITS.get(self._units.get(units[index], ""))
        multiplier = self._multipliers.get(multipliers[index], 0.0) if layout.integer(column) else 1.0
        if unit is None or not 0.0 < multiplier < math.inf:  # 0: none; ?: not known to the firmware's authors
            return usual
        return unit * multiplier
