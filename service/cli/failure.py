"""How a command ends that cannot do its work: in words on standard error, and with the status that fits."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import NoReturn

DONE, FAILED, WRONG_USE = 0, 1, 2


class CommandError(Exception):
    """The command was used rightly and could not do its work; the text says why (exit 1)."""


def say(text: str) -> None:
    """Write a line to standard error, as it is."""
    sys.stderr.write(text + "\n")


def reported(command: Callable[[], object]) -> int:
    """Run ``command``; return the exit status, having said what went wrong.

    A wrong configuration is wrong use. What is not foreseen is a defect: its traceback goes out, exit 1.
    """
    from service.config.complaints import ConfigurationError

    try:
        command()
    except ConfigurationError as error:
        for line in error.errors:
            say(line)
        count = "1 error" if len(error.errors) == 1 else f"{len(error.errors)} errors"
        say(f"{count} in the configuration; docs/configuration.md has every key")
        return WRONG_USE
    except CommandError as error:
        say(str(error))
        return FAILED
    except SystemExit as leaving:
        return _status(leaving)
    return DONE


def _status(leaving: SystemExit) -> int:
    """Return 0, 1 or 2 for how a command left; an interrupt (130 to the library) is a failure."""
    if leaving.code is None:
        return DONE
    return WRONG_USE if leaving.code == WRONG_USE else DONE if leaving.code == DONE else FAILED


def leave(status: int | None) -> NoReturn:
    """End a command with the status that its room returned; ``None`` is done."""
    raise SystemExit(DONE if status is None else status)
