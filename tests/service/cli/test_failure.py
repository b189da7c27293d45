from __future__ import annotations

import pytest

from service.cli.failure import CommandError, leave, reported
from service.config import ConfigurationError


def raising(error: BaseException) -> int:
    def command() -> None:
        raise error

    return reported(command)


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (CommandError("no systemd"), 1),
        (ConfigurationError(["robot.toml: a", "robot.toml: b"]), 2),
        (SystemExit(0), 0),
        (SystemExit(None), 0),
        (SystemExit(2), 2),
        (SystemExit(130), 1),
        (SystemExit(-15), 1),
        (SystemExit("why"), 1),
    ],
)
def test_every_end_has_one_of_three_statuses(error: BaseException, status: int) -> None:
    assert raising(error) == status


def test_a_command_that_returns_is_done() -> None:
    assert reported(lambda: None) == 0


@pytest.mark.parametrize(("status", "expected"), [(None, 0), (0, 0), (1, 1), (2, 2)])
def test_what_a_room_returns_is_the_status(status: int | None, expected: int) -> None:
    assert reported(lambda: leave(status)) == expected


def test_what_was_not_foreseen_is_not_hidden() -> None:
    with pytest.raises(ZeroDivisionError):
        raising(ZeroDivisionError())


def test_errors_go_out_line_by_line(capsys: pytest.CaptureFixture[str]) -> None:
    raising(ConfigurationError(["robot.toml: a"]))
    assert capsys.readouterr().err.splitlines()[:2] == [
        "robot.toml: a",
        "1 error in the configuration; docs/configuration.md has every key",
    ]
