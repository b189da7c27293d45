"""Calls to the system's own programs, with what they said when they failed."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path


class InstallError(Exception):
    """The system refused a step; the text says which, and what would help."""


def call(*command: str) -> str:
    """Run a program to its end and return what it printed.

    Raises
    ------
    InstallError
        It is absent, or ended with another status than 0.
    """
    if shutil.which(command[0]) is None:
        raise InstallError(
            f"{command[0]} is not on this machine; beliefd service needs systemd and shadow-utils"
        )
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        said = (done.stderr or done.stdout).strip()
        raise InstallError(f"{' '.join(command)}: exit {done.returncode}: {said}")
    return done.stdout


def watched(command: Sequence[str]) -> None:
    """Run a program to its end with its output going to the terminal.

    Raises
    ------
    InstallError
        It ended with another status than 0.
    """
    status = subprocess.run(command, check=False).returncode
    if status != 0:
        raise InstallError(f"{' '.join(command)}: exit {status}")


def as_user(user: str, *command: str, **environment: str) -> list[str]:
    """Return a command that runs ``command`` as ``user`` with only this environment."""
    settings = [f"{name}={value}" for name, value in environment.items()]
    return ["runuser", "-u", user, "--", "env", "-i", "PATH=/usr/bin:/bin", *settings, *command]


def need_root(doing: str) -> None:
    """Refuse to go on as another user than root.

    Raises
    ------
    InstallError
        Said before anything is changed.
    """
    if os.geteuid() != 0:
        raise InstallError(f"{doing} changes the system and must be root: sudo {doing}")


def need_systemd() -> None:
    """Refuse to go on where systemd is not running.

    Raises
    ------
    InstallError
        Said before anything is changed.
    """
    if not Path("/run/systemd/system").is_dir():
        raise InstallError("systemd is not running on this machine; beliefd run CONFIG needs none")
