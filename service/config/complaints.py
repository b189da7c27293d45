"""What is wrong with a configuration, in the words of the file rather than of the validator.

Every error names its place as the file shows it (``beacon 7, position``; ``link "bus" (link 2), channel``),
what would be right there, and what was found.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from service.config import structure
from service.config.described import description
from service.config.places import place_in_words
from service.config.section import Section, shown


class ConfigurationError(Exception):
    """The configuration cannot be used.

    Attributes
    ----------
    errors : list[str]
        Every error found, each with the file's name and the place in it.
    """

    def __init__(self, errors: list[str]) -> None:
        super().__init__("\n".join(errors))
        self.errors = errors


def did_you_mean(wrong: object, possible: Iterable[str]) -> str:
    """Return ``; did you mean "rate"?`` for the closest possible word, or nothing when none is close."""
    close = difflib.get_close_matches(str(wrong), list(possible), n=1, cutoff=0.6)
    return f'; did you mean "{close[0]}"?' if close else ""


def _limit(relation: str, key: str) -> Callable[[ErrorDetails], str]:
    def words(error: ErrorDetails) -> str:
        limit = error.get("ctx", {}).get(key)
        return f"needs {relation} {limit:g}, got {shown(error['input'])}"

    return words


def _needs(what: str) -> Callable[[ErrorDetails], str]:
    return lambda error: f"needs {what}, got {shown(error['input'])}"


def _one_of(error: ErrorDetails) -> str:
    context = error.get("ctx", {})
    expected = str(context.get("expected") or context.get("expected_tags")).replace(" or ", ", ")
    words = [word.strip().strip("'") for word in expected.split(",")]
    given = context.get("tag", error["input"])
    return f"needs one of {', '.join(words)}, got {shown(given)}{did_you_mean(given, words)}"


def _pattern(error: ErrorDetails) -> str:
    return f"needs text of the form {error.get('ctx', {}).get('pattern')}, got {shown(error['input'])}"


_WORDS: dict[str, Callable[[ErrorDetails], str]] = {
    "missing": lambda error: "is missing",
    "float_type": _needs("a number"),
    "finite_number": _needs("a finite number"),
    "int_type": _needs("a whole number"),
    "bool_type": _needs("true or false"),
    "string_type": _needs("text in quotes"),
    "tuple_type": _needs("an array"),
    "dict_type": _needs("a table"),
    "model_type": _needs("a table"),
    "model_attributes_type": _needs("a table"),
    "greater_than": _limit("more than", "gt"),
    "greater_than_equal": _limit("at least", "ge"),
    "less_than": _limit("less than", "lt"),
    "less_than_equal": _limit("at most", "le"),
    "string_too_short": lambda error: "needs a text that is not empty",
    "string_pattern_mismatch": _pattern,
    "literal_error": _one_of,
    "union_tag_invalid": _one_of,
    "union_tag_not_found": lambda error: "is missing",
}


def _described(error: ErrorDetails, root: type[Section]) -> str:
    """Return what is wrong and what would be right."""
    place = error["loc"]
    if error["type"] == "extra_forbidden":
        section = structure.at(root, place[:-1])
        return f"unknown key{did_you_mean(place[-1], section.model_fields if section else ())}"
    words = _WORDS.get(error["type"])
    if words is None:
        return error["msg"]
    said = words(error)
    if error["type"] == "missing":
        section = structure.at(root, place[:-1])
        meaning = description(section, str(place[-1])) if section else ""
        if meaning:
            said += f": {meaning}"
    return said


def complaints(error: ValidationError, raw: Mapping[str, Any], root: type[Section]) -> list[str]:
    """Return every error of a validation as ``place: what is wrong``, in the order of the file's sections."""
    order = ("vehicle", "origin", "start", "area", "loop", "budget", "link")

    def section(detail: ErrorDetails) -> int:
        first = str(detail["loc"][0]) if detail["loc"] else ""
        return order.index(first) if first in order else len(order)

    found: list[str] = []
    for detail in sorted(error.errors(include_url=False), key=section):
        place = detail["loc"]
        if detail["type"].startswith("union_tag"):
            place = (*place, "kind")
        found.append(f"{place_in_words(place, raw)}: {_described(detail, root)}")
    return found
