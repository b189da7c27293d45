"""Names become keys only where Zenoh allows it."""

from __future__ import annotations

import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st

from service.publish.topics import LIVE, QUERIES, TOPICS, Keys, live, vehicle_of


def test_the_keys_are_those_of_the_interface() -> None:
    keys = Keys("beliefd/v1", "mower")
    assert [keys.of(topic.key) for topic in TOPICS] == [
        "beliefd/v1/mower/estimate",
        "beliefd/v1/mower/estimate/slow",
        "beliefd/v1/mower/hypotheses",
        "beliefd/v1/mower/particles",
        "beliefd/v1/mower/budget",
        "beliefd/v1/mower/sensors",
        "beliefd/v1/mower/health",
    ]
    assert [keys.of(key) for key in (*QUERIES, LIVE)] == [
        "beliefd/v1/mower/@rpc/latest",
        "beliefd/v1/mower/@rpc/status",
        "beliefd/v1/mower/@rpc/config",
        "beliefd/v1/mower/@rpc/schema",
        "beliefd/v1/mower/@live",
    ]
    assert live("beliefd/v1") == "beliefd/v1/*/@live"


def test_the_qualities_of_service_are_those_of_the_interface() -> None:
    priority = zenoh.Priority
    assert {topic.key: (topic.priority, topic.encoding) for topic in TOPICS} == {
        "estimate": (priority.REAL_TIME, "application/json;beliefd.Estimate"),
        "estimate/slow": (priority.DATA, "application/json;beliefd.Estimate"),
        "hypotheses": (priority.DATA_HIGH, "application/json;beliefd.Hypotheses"),
        "particles": (priority.BACKGROUND, "application/octet-stream;beliefd.Cloud"),
        "budget": (priority.DATA_LOW, "application/json;beliefd.Budget"),
        "sensors": (priority.DATA_LOW, "application/json;beliefd.Sensors"),
        "health": (priority.INTERACTIVE_HIGH, "application/json;beliefd.Health"),
    }


@pytest.mark.parametrize("name", ["", "a/b", "a*", "$*", "a#b", "what?", "@mower", "/"])
def test_what_cannot_be_a_chunk_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match=r"beliefd/v1/|vehicle"):
        Keys("beliefd/v1", name)


@pytest.mark.parametrize("prefix", ["", "/beliefd", "beliefd/", "a//b", "a/#"])
def test_what_cannot_be_a_prefix_is_refused(prefix: str) -> None:
    with pytest.raises(ValueError, match="is not a Zenoh key"):
        Keys(prefix, "mower")


@given(st.text(st.characters(codec="utf-8", exclude_characters="/*$#?@"), min_size=1, max_size=20))
def test_a_vehicle_is_found_again_in_its_keys(name: str) -> None:
    keys = Keys("fleet/v1", name)
    for key in (*(topic.key for topic in TOPICS), LIVE):
        assert vehicle_of("fleet/v1", keys.of(key)) == name
