"""Every exercise and figure is made, says what its axes are, has numbers, and is drawn to the same bytes."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from typer.testing import CliRunner

from service.cli import failure
from service.cli.application import application
from service.textbook import catalogue, style
from service.textbook.exhibit import Exhibit


@pytest.fixture(autouse=True)
def _style() -> Iterator[None]:
    with style.styled():
        yield


def drawn(exhibit: Exhibit, path: Path) -> str:
    style.save(exhibit.picture, path)
    return path.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", list(catalogue.CATALOGUE))
def test_every_exhibit_is_made_and_labelled(name: str, tmp_path: Path) -> None:
    exhibit = catalogue.make(name)
    for axis in exhibit.picture.axes:
        assert axis.get_title(), f"{name}: a panel without a title"
        assert axis.get_xlabel(), f"{name}, {axis.get_title()}: no x label"
        assert axis.get_ylabel(), f"{name}, {axis.get_title()}: no y label"
    assert exhibit.tables
    for table in exhibit.tables:
        assert table.rows, table.title
        assert {len(row) for row in table.rows} == {len(table.columns)}, table.title
        assert not any("nan" in cell.lower() for row in table.rows for cell in row), table.title
    text = drawn(exhibit, tmp_path / "picture.svg")
    assert ET.fromstring(text).tag.endswith("svg")
    assert len(text) < 250_000


@pytest.mark.parametrize("name", ["exercise-3", "figure-4.3", "figure-4.7"])
def test_the_bytes_are_the_same_every_time(name: str, tmp_path: Path) -> None:
    first, second = (drawn(catalogue.make(name), tmp_path / f"{run}.svg") for run in range(2))
    assert first == second
    assert "<dc:date>" not in first


def test_places_are_rounded_and_nothing_else_is() -> None:
    text = '<path d="M 1.23456 7\n   L -0.5 10.999999" transform="translate(0.128 1) scale(0.123456)"/>'
    expected = '<path d="M 1.23 7\nL -0.5 10.99" transform="translate(0.12 1) scale(0.123456)"/>'
    assert style.compact(text) == expected


def invoke(*arguments: str) -> tuple[int, str]:
    said = CliRunner().invoke(application, ["textbook", *arguments], env={"COLUMNS": "160", "TERM": "dumb"})
    return said.exit_code, said.output


def test_the_list_names_them_all() -> None:
    status, said = invoke("--list")
    assert status == 0
    for name, entry in catalogue.CATALOGUE.items():
        assert name in said
        assert entry.title in said


def test_a_named_figure_is_written_with_its_numbers(tmp_path: Path) -> None:
    status, said = invoke("figure-4.7", "figure-4.7", "--out", str(tmp_path / "new"))
    assert status == 0, said
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["figure-4.7.svg"]
    assert "cumulative" not in said
    assert "r = 0.0775" in said


def test_an_unknown_name_is_wrong_use(tmp_path: Path) -> None:
    status, said = invoke("figure-4.8", "--out", str(tmp_path))
    assert status == 2
    assert "figure-4.8" in said
    assert not any(tmp_path.iterdir())


def test_a_folder_that_cannot_be_made_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    occupied = tmp_path / "file"
    occupied.write_text("")

    def command() -> None:
        application(["textbook", "figure-4.7", "--out", str(occupied)], standalone_mode=False)

    assert failure.reported(command) == 1
    assert f"cannot be written to {occupied}" in capsys.readouterr().err


def test_without_matplotlib_it_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    find_spec = importlib.util.find_spec
    monkeypatch.setattr(
        "service.cli.textbook.find_spec", lambda name: None if name == "matplotlib" else find_spec(name)
    )

    def command() -> None:
        application(["textbook", "figure-4.7"], standalone_mode=False)

    assert failure.reported(command) == 1
    assert "pip install 'beliefd[textbook]'" in capsys.readouterr().err


def test_listing_needs_no_matplotlib() -> None:
    """The catalogue names modules; none is imported before an exhibit is made."""
    assert all(":" in entry.place for entry in catalogue.CATALOGUE.values())
