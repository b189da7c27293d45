"""docs/wire.md is what is declared, and its example is the one that runs."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from service.estimate import schema
from service.publish.reference import SUBSCRIBER, page
from service.publish.topics import LIVE, QUERIES, REQUESTS, TOPICS
from tests.service.publish.conftest import Daemon
from tests.service.publish.spoken import estimate, tagged, wait_for

ROOT = Path(__file__).parents[3]


def test_the_page_is_up_to_date() -> None:
    assert (ROOT / "docs" / "wire.md").read_text(encoding="utf-8") == page(), "run: make docs"


def test_the_documented_keys_are_the_declared_ones() -> None:
    introduction = page().partition("## The values")[0]
    documented = re.findall(r"^\| `([^`]+)` \|", introduction, re.MULTILINE)
    assert documented == [topic.key for topic in TOPICS] + list(QUERIES) + list(REQUESTS)
    assert f"`{LIVE}`" in introduction


def test_every_value_of_the_schema_is_documented_field_by_field() -> None:
    """Each of the schema's properties has a row with a meaning."""
    for name, definition in schema()["$defs"].items():  # type: ignore[attr-defined]
        if "properties" not in definition:
            continue
        (section,) = re.findall(rf"^### {name}\n(.*?)(?=^### |\Z)", page(), re.MULTILINE | re.DOTALL)
        rows = [line for line in section.splitlines() if line.startswith("| `")]
        assert all(row.rstrip("| ").endswith((".", "…")) for row in rows), rows
        fields = [field for row in rows for field in re.findall(r"`(\w+)`", row.split(" | ")[0])]
        assert fields == list(definition["properties"])


def test_the_example_is_the_page_s(endpoint: str, start: Callable[..., Daemon], tmp_path: Path) -> None:
    """It runs as it is printed, but for the port, which is the test's own."""
    example = (ROOT / "examples" / "subscribe.py").read_text(encoding="utf-8")
    assert example.endswith(SUBSCRIBER)
    script = tmp_path / "subscribe.py"
    script.write_text(example.replace("tcp/127.0.0.1:7447", endpoint))
    daemon = start(endpoint)
    wait_for(lambda: "publishing" in daemon.log.read_text())
    said = tmp_path / "said.txt"
    with said.open("w") as out:
        process = subprocess.Popen([sys.executable, "-u", str(script)], stdout=out, stderr=subprocess.STDOUT)
    try:

        def _first_line() -> str | None:
            daemon.send(tagged(b"E", estimate(3)))
            return (said.read_text().splitlines() or [None])[0]

        assert wait_for(_first_line) == "tracking [4.0, -2.0, None] 0.49"
    finally:
        process.kill()
        process.wait()
