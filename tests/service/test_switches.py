"""Switches of [honesty] turned off by name."""

from __future__ import annotations

from pathlib import Path

import pytest

from service.config import Honesty, load
from service.switches import switched_off, unknown_switches

EXAMPLE = Path(__file__).parents[2] / "beliefd.example.toml"


@pytest.mark.parametrize("switch", list(Honesty.model_fields))
def test_each_switch_turns_off_itself_and_nothing_else(switch: str) -> None:
    configuration = load(EXAMPLE)
    without = switched_off(configuration, (switch,))
    before, after = configuration.model_dump(), without.model_dump()
    assert after["honesty"] == before["honesty"] | {switch: False}
    assert {**after, "honesty": None} == {**before, "honesty": None}


def test_a_name_that_is_none_is_told_with_those_there_are() -> None:
    assert unknown_switches(("trust", "recovery")) == ""
    said = unknown_switches(("trust", "trusting"))
    assert said.startswith("--without trusting:")
    assert all(name in said for name in Honesty.model_fields)
