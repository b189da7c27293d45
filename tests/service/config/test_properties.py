"""Whatever a TOML file may hold, reading it gives a configuration or its errors, and never anything else."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, date, datetime, time
from pathlib import Path
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from service.config import Configuration, ConfigurationError, Site, load, site, validated

KEYS = sorted(
    {
        "name",
        "kind",
        "url",
        "id",
        "position",
        "link",
        "sensor",
        "beacon",
        "signal",
        "servo",
        "mode",
        "channel",
    }
    | {"dbc", "terrain", "rates", "options", "beacons", "estimate", "heading", "sigma", "rate", "cpu_ms", "x"}
    | set(Configuration.model_fields)
)
WORDS = [
    "mavlink",
    "can",
    "zenoh",
    "range",
    "global",
    "given",
    "dbc",
    "unicycle",
    "a" * 5000,
    "",
    "\0",
    "can can",
]

scalars = (
    st.sampled_from(WORDS)
    | st.text(max_size=8)
    | st.integers()
    | st.just(10**400)
    | st.floats()
    | st.booleans()
    | st.just(datetime(2026, 11, 21, tzinfo=UTC))
    | st.just(date(2026, 11, 21))
    | st.just(time(12, 0))
)
values = st.recursive(
    scalars,
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.sampled_from(KEYS) | st.text(max_size=4), inner, max_size=5)
    ),
    max_leaves=20,
)
files = st.dictionaries(st.sampled_from(KEYS) | st.text(max_size=4), values, max_size=8)


def errors_of(reading: Callable[[], object]) -> list[str] | None:
    try:
        reading()
    except ConfigurationError as error:
        return error.errors
    return None


def outcome(raw: dict[str, Any], model: type[Configuration] | type[Site]) -> None:
    found = errors_of(lambda: validated(raw, model, "robot.toml"))
    assert found is None or found
    assert all(line.startswith("robot.toml: ") and "\n" not in line for line in found or [])


@settings(max_examples=400, deadline=None)
@given(files)
def test_any_content_gives_a_configuration_or_its_errors(raw: dict[str, Any]) -> None:
    outcome(raw, Configuration)
    outcome(raw, Site)


@settings(max_examples=300, deadline=None)
@given(content=st.binary(max_size=200) | st.text(alphabet='[]="\n.aà1{}#,', max_size=80).map(str.encode))
def test_any_bytes_give_a_configuration_or_its_errors(tmp_path_factory: Any, content: bytes) -> None:
    path: Path = tmp_path_factory.getbasetemp() / "any.toml"
    path.write_bytes(content)
    for read in (load, site):
        found = errors_of(lambda read=read: read(path))
        assert found is None or found
