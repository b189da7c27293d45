"""The string below a key is found, as pydantic itself would find it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from pydantic import ConfigDict

from service.config import Configuration, structure
from service.config.described import description
from service.config.section import Section


def every(section: type[Section]) -> Iterator[type[Section]]:
    yield section
    for field in section.model_fields.values():
        for inner in structure.sections(field.annotation):
            yield from every(inner)


@pytest.mark.parametrize("section", dict.fromkeys(every(Configuration)))
def test_every_key_is_described(section: type[Section]) -> None:
    for key in section.model_fields:
        assert description(section, key), key


class Inner(Section):
    model_config = ConfigDict(use_attribute_docstrings=True)

    first: int = 1
    """One.

    And more."""
    silent: int = 2
    last: str = ""
    """The last."""


class Outer(Inner):
    own: int = 3
    """Its own."""


@pytest.mark.parametrize("key", Outer.model_fields)
def test_it_is_what_pydantic_finds(key: str) -> None:
    assert description(Outer, key) == (Outer.model_fields[key].description or "")


def test_a_key_that_is_none_has_no_description() -> None:
    assert description(Outer, "model_config") == ""
    assert description(Outer, "nothing") == ""
