"""How the topics of a ULog are laid out, as the log itself says: formats (F) and subscriptions (A).

https://docs.px4.io/main/en/dev_log/ulog_file_format.html. A format lists types and names of its fields, which may be
arrays and other formats; here it is flattened once into one :class:`struct.Struct`, with names as PX4's tools write
them: ``q[0]``, ``esc[1].esc_rpm``.
"""

from __future__ import annotations

import re
import struct
from typing import NamedTuple

_CODES = {
    "int8_t": "b", "uint8_t": "B", "int16_t": "h", "uint16_t": "H", "int32_t": "i", "uint32_t": "I",
    "int64_t": "q", "uint64_t": "Q", "float": "f", "double": "d", "bool": "?", "char": "c",
}  # fmt: skip
_FIELD = re.compile(
    r"(?P<type>[A-Za-z0-9_-]{1,128})(?:\[(?P<count>\d{1,5})\])? (?P<name>[A-Za-z0-9_.]{1,128})"
)

MOST_FORMATS = 4096
MOST_FIELDS = 4096
DEEPEST = 8


class Field(NamedTuple):
    """One entry of a format; ``length`` is ``None`` where it is no array."""

    type: str
    length: int | None
    name: str


class Topic:
    """A subscription: which instance of which topic, and where its fields lie.

    Attributes
    ----------
    name : str
        ``sensor_combined``.
    instance : int
        From 0, where there are several.
    sizes : tuple[int, int]
        Fewest and most bytes of a message: padding at its end may be left out.
    """

    def __init__(self, name: str, instance: int, names: list[str], codes: str) -> None:
        self.name = name
        self.instance = instance
        full = struct.calcsize("<" + codes)
        while names and names[-1].startswith("_padding"):
            names.pop()
            codes = codes[:-1]
        self._struct = struct.Struct("<" + codes)
        self._names = names
        self.sizes = (self._struct.size, full)

    @property
    def columns(self) -> list[str]:
        """The names of its fields."""
        return self._names

    def fields(self, body: bytes) -> dict[str, float]:
        """Return the numbers of a message by name."""
        values = self._struct.unpack_from(body)
        return {
            name: value
            for name, value in zip(self._names, values, strict=True)
            if not isinstance(value, bytes)
        }


class Formats:
    """The formats of a log; what cannot be true is refused, and memory is bounded."""

    def __init__(self) -> None:
        self._known: dict[str, list[Field]] = {}

    def define(self, text: str) -> bool:
        """Take in ``name:type field;type[3] field;``; ``False`` when it is none."""
        name, colon, rest = text.partition(":")
        parts = [part for part in rest.split(";") if part]
        matches = [_FIELD.fullmatch(part) for part in parts]
        if not colon or not name or not matches or len(self._known) >= MOST_FORMATS:
            return False
        fields: list[Field] = []
        for match in matches:
            if match is None:
                return False
            count = match["count"]
            fields.append(Field(match["type"], None if count is None else int(count), match["name"]))
        self._known[name] = fields
        return True

    def topic(self, name: str, instance: int) -> Topic | None:
        """Return a subscription to ``name``; ``None`` when its format is not known, or too large."""
        names: list[str] = []
        codes: list[str] = []
        if name not in self._known or not self._flatten(name, "", names, codes, 0):
            return None
        return Topic(name, instance, names, "".join(codes))

    def _flatten(self, name: str, prefix: str, names: list[str], codes: list[str], depth: int) -> bool:
        fields = self._known.get(name)
        if fields is None or depth > DEEPEST:
            return False
        for field in fields:
            places = [""] if field.length is None else [f"[{index}]" for index in range(field.length)]
            for place in places:
                if len(names) >= MOST_FIELDS:
                    return False
                code = _CODES.get(field.type)
                if code is not None:
                    names.append(f"{prefix}{field.name}{place}")
                    codes.append(code)
                elif not self._flatten(field.type, f"{prefix}{field.name}{place}.", names, codes, depth + 1):
                    return False
        return True
