"""The command line: lists, teaches, refuses."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from sim_vehicle import scenarios
from sim_vehicle.cli import application

RUN = CliRunner()


def test_alone_it_lists_the_scenarios() -> None:
    result = RUN.invoke(application, [])
    assert result.exit_code == 0
    assert [line.split()[0] for line in result.output.splitlines()] == scenarios.names()


def test_help_teaches_every_option() -> None:
    result = RUN.invoke(application, ["--help"], env={"COLUMNS": "200", "NO_COLOR": "1", "TERM": "dumb"})
    assert result.exit_code == 0
    for option in (
        "--seed",
        "--seconds",
        "--mavlink",
        "--can",
        "--realtime",
        "--write",
        "--truth",
        "--config",
    ):
        assert option in result.output


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["nosuch", "--write", "x"], "no scenario 'nosuch'; there are beacons, demo"),
        (["beacons"], "needs either --mavlink URL"),
        (["beacons", "--realtime"], "needs either --mavlink URL"),
        (
            ["beacons", "--write", "x", "--realtime", "--mavlink", "udpin:127.0.0.1:0"],
            "or --write STEM alone",
        ),
        (["beacons", "--realtime", "--mavlink", "smoke:signals"], "--mavlink smoke:signals: needs udpout"),
        (
            ["demo", "--realtime", "--mavlink", "udpin:127.0.0.1:0", "--can", "socketcan:"],
            "needs INTERFACE:CHANNEL",
        ),
        (
            ["demo", "--mavlink", "udpin:127.0.0.1:0", "--can", "nosuchcan9"],
            "--can nosuchcan9: ",
        ),
        (["beacons", "--seed", "-1", "--write", "x"], "--seed"),
        (["beacons", "--seconds", "0", "--write", "x"], "--seconds"),
        (["--nosuch"], "--nosuch"),
    ],
)
def test_wrong_use_ends_with_2_and_says_what_would_be_right(arguments: list[str], complaint: str) -> None:
    result = RUN.invoke(application, arguments, env={"COLUMNS": "200", "NO_COLOR": "1", "TERM": "dumb"})
    assert result.exit_code == 2
    assert complaint in result.output


def test_writing_names_the_files(tmp_path: Path) -> None:
    result = RUN.invoke(
        application, ["beacons", "--seed", "3", "--seconds", "0.5", "--write", str(tmp_path / "b")]
    )
    assert result.exit_code == 0
    assert str(tmp_path / "b.tlog") in result.output
    assert "26 truth rows" in result.output


def test_a_folder_that_cannot_be_written_is_a_failure(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    result = RUN.invoke(application, ["beacons", "--seconds", "0.5", "--write", str(tmp_path / "file" / "b")])
    assert result.exit_code == 1
    assert "--write" in result.output
