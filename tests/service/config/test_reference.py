from __future__ import annotations

from pathlib import Path

from service.config.reference import page

ROOT = Path(__file__).parents[3]


def test_the_page_is_up_to_date() -> None:
    committed = (ROOT / "docs" / "configuration.md").read_text(encoding="utf-8")
    assert committed == page(), "run: make docs"


def test_every_key_of_the_page_says_what_it_means() -> None:
    rows = [line for line in page().splitlines() if line.startswith("| `")]
    assert len(rows) > 70
    for row in rows:
        assert row.rstrip("| ").endswith("."), row
