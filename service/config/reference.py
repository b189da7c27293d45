"""The reference page of the configuration, made from the sections themselves: docs/configuration.md.

``python -m service.config.reference > docs/configuration.md``; a test fails when the page is out of date.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from typing import Any, cast

from service.config import structure
from service.config.checks import NOT_BUILT, NOT_READ
from service.config.configuration import Configuration
from service.config.described import description
from service.config.section import Section

_INTRODUCTION = """\
# Configuration

One TOML file. Unknown keys, wrong types and values out of bounds are errors, all reported together, each
with its place in the file; `beliefd check FILE` shows them, or what would run. Everything has a default but
`vehicle`, one `link` and the sensors' facts. SI units, radians, north-east-down; a key carries a unit in its
name only where it is another. Paths are relative to the file's folder. A complete example:
`beliefd.example.toml`.

This page is made from the program: `python -m service.config.reference > docs/configuration.md`.
"""

_ORDER = ("vehicle", "origin", "start", "area", "loop", "budget", "link")

Schema = Mapping[str, Any]


def _short(number: float) -> str:
    return f"{number:,}" if number == int(number) else f"{number:g}"


def _bounds(schema: Schema) -> str:
    """Return the bounds of a number: ``0 … 1``, ``> 0``, ``0 ≤ … < 1``."""
    low, above = schema.get("minimum"), schema.get("exclusiveMinimum")
    high, below = schema.get("maximum"), schema.get("exclusiveMaximum")
    if low is not None and high is not None:
        return f"{_short(low)} … {_short(high)}"
    parts = [
        f"{sign} {_short(limit)}"
        for sign, limit in (("≥", low), (">", above), ("≤", high), ("<", below))
        if limit is not None
    ]
    return " and ".join(parts)


def _type(schema: Schema) -> str:
    """Return what a value is, in words: ``3 numbers``, ``"given" | "global"``, ``whole number 1 … 64``."""
    if "anyOf" in schema:
        return _type(next(choice for choice in schema["anyOf"] if choice.get("type") != "null"))
    if "enum" in schema or "const" in schema:
        return " ∣ ".join(f'"{value}"' for value in schema.get("enum", [schema.get("const")]))
    if schema.get("type") == "array":
        return _array(schema)
    if schema.get("type") == "object":
        inner = schema.get("additionalProperties")
        return f"table of {_type(cast('Schema', inner))}" if isinstance(inner, Mapping) and inner else "table"
    word = {"number": "number", "integer": "whole number", "boolean": "true or false", "string": "text"}
    return f"{word.get(str(schema.get('type')), 'any')} {_bounds(schema)}".strip()


def _array(schema: Schema) -> str:
    if "prefixItems" in schema:
        first = cast("Schema", schema["prefixItems"][0])
        return f"{len(schema['prefixItems'])} numbers {_bounds(first)}".strip()
    return f"array of: {_type(cast('Schema', schema['items']))}"


def _default(schema: Schema) -> str:
    if "default" not in schema:
        return "none"
    default = schema["default"]
    if default is None:
        return "none"
    if isinstance(default, bool):
        return f"`{str(default).lower()}`"
    return f'`"{default}"`' if isinstance(default, str) else f"`{default}`"


def _planned(path: str, name: str) -> str:
    """Return which values of a key are accepted by the grammar and refused by this version."""
    values, _ = NOT_BUILT.get((path, name), (frozenset[object](), ""))
    if (path, name) in NOT_READ:
        return " Not in this version."
    return f" Not in this version: {', '.join(sorted(map(str, values)))}." if values else ""


def _rows(path: str, section: type[Section]) -> Iterator[str]:
    schema = section.model_json_schema()
    required = set(cast("list[str]", schema.get("required", [])))
    for name, field in section.model_fields.items():
        if structure.sections(field.annotation):
            continue
        facts = cast("Schema", schema["properties"][name])
        default = "**required**" if name in required and not _filled_in(section, name) else _default(facts)
        meaning = " ".join(description(section, name).split()) + _planned(path, name)
        yield f"| `{name}` | {_type(facts)} | {default} | {meaning} |"


def _filled_in(section: type[Section], name: str) -> bool:
    """Tell whether a required key is filled in from the others (start, mode)."""
    return (section.__name__, name) == ("Start", "mode")


def _heading(path: str, section: type[Section], array: bool) -> str:
    kind = structure.kind_of(section)
    title = f"[[{path}]]" if array else f"[{path}]"
    return f'`{title}` with `kind = "{kind}"`' if kind else f"`{title}`"


def _section(path: str, section: type[Section], array: bool) -> Iterator[str]:
    """Return the lines of one section, then those of the sections inside it."""
    yield f"\n## {_heading(path, section, array)}\n"
    yield (section.__doc__ or "").strip() + "\n"
    yield "| key | value | default | meaning |"
    yield "|---|---|---|---|"
    yield from _rows(path, section)
    for name, field in section.model_fields.items():
        for inner in structure.sections(field.annotation):
            yield from _section(f"{path}.{name}", inner, structure.is_array(field.annotation))


def page() -> str:
    """Return the page as Markdown."""
    lines = [_INTRODUCTION.rstrip("\n")]
    names = [*_ORDER, *(name for name in Configuration.model_fields if name not in _ORDER)]
    for name in names:
        annotation = Configuration.model_fields[name].annotation
        for section in structure.sections(annotation):
            lines.extend(_section(name, section, structure.is_array(annotation)))
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.stdout.write(page())
