"""One plausible reading of every kind, with every field set."""

from __future__ import annotations

import typing

from drivers.sample import AnyReading

KINDS: tuple[type[AnyReading], ...] = typing.get_args(AnyReading)


def fields(kind: type[AnyReading]) -> dict[str, typing.Any]:
    """A value for each field, by its type."""
    hints = typing.get_type_hints(kind)
    return {name: _value(str(hints[name])) for name in kind.__struct_fields__}


def _value(hint: str) -> object:
    if "tuple" in hint:
        return (0.5, 0.25, 0.125)
    if "bool" in hint:
        return True
    return 1.0 if "float" in hint else 1


def floating(kind: type[AnyReading]) -> list[str]:
    """The fields that hold floating-point numbers, one or several."""
    hints = typing.get_type_hints(kind)
    return [name for name in kind.__struct_fields__ if "float" in str(hints[name])]
