"""Installing and removing the service: account, folders, configuration, kernels, unit."""

from __future__ import annotations

import os
import pwd
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

from service.config import load
from service.install.copying import copied, hidden
from service.install.system import InstallError, as_user, call, need_root, need_systemd, watched
from service.install.unit import USER, Names, render

CACHE = Path("/var/cache/beliefd")
STATE = Path("/var/lib/beliefd")

Say = Callable[[str], None]


def executable() -> Path:
    """Return the ``beliefd`` script of this environment.

    Raises
    ------
    InstallError
        There is none, or it lies where the service cannot see it.
    """
    # not resolved: an environment's python is a link to the system's
    script = Path(sys.executable).absolute().parent / "beliefd"
    if not script.is_file():
        raise InstallError(f"there is no {script}: install the distribution beliefd into this environment")
    if hidden(script):
        raise InstallError(
            f"the service cannot see {script.parent.parent}: home directories and /tmp are hidden from it; "
            "install from an environment elsewhere: python3 -m venv /opt/beliefd && "
            "/opt/beliefd/bin/pip install beliefd && /opt/beliefd/bin/beliefd service install CONFIG"
        )
    return script


def _account() -> None:
    try:
        pwd.getpwnam(USER)
    except KeyError:
        call(
            "useradd", "--system", "--user-group", "--no-create-home", "--home-dir", str(STATE),
            "--shell", "/usr/sbin/nologin", "--comment", "belief daemon", USER,
        )  # fmt: skip


def _belongs_to_others(folder: Path) -> bool:
    try:
        return folder.owner() != USER
    except KeyError:  # of an account that is no more: an earlier installation's
        return False


def owned(folder: Path) -> None:
    """Make a folder of the service's own, or take over an empty one.

    Raises
    ------
    InstallError
        It holds what belongs to others: as the service's own they could not reach it any more.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if folder not in (CACHE, STATE) and any(folder.iterdir()) and _belongs_to_others(folder):
        raise InstallError(
            f"{folder} is somebody else's and is not empty; name a folder of the service's own, "
            f'as state.directory = "{STATE}"'
        )
    folder.chmod(0o750)
    shutil.chown(folder, USER, USER)


def install(source: Path, name: str | None, say: Say) -> Names:
    """Make everything that the service needs and write its unit; it is not started.

    Parameters
    ----------
    source : Path
        The configuration; a copy of it goes to ``/etc/beliefd``.
    name : str or None
        One of several installations, or the only one.
    say : callable
        Called with each step.

    Raises
    ------
    InstallError
        Not root, no systemd, a state directory that is somebody else's, or a step was refused.
    ConfigurationError
        The configuration is wrong; nothing was changed.
    """
    need_root("beliefd service install")
    need_systemd()
    names, configuration, script = Names.of(name), load(source), executable()
    say(f"user {USER}")
    _account()
    for folder in (CACHE, Path(configuration.state.directory)):
        owned(folder)
    for path in copied(source.resolve(), names.configuration, USER):
        say(f"configuration {path}")
    call(*as_user(USER, str(script), "check", str(names.configuration)))
    say(f"kernels, as {USER}, in {CACHE}")
    watched(
        as_user(USER, str(script), "warm", CACHE_DIRECTORY=str(CACHE), TERM=os.environ.get("TERM", "dumb"))
    )
    names.unit_file.write_text(render(names, load(names.configuration), script), encoding="utf-8")
    say(f"unit {names.unit_file}")
    call("systemctl", "daemon-reload")
    return names


def start(names: Names) -> None:
    """Start the service now and at every boot; return when it says that it is ready.

    Raises
    ------
    InstallError
        It did not become ready; with the end of its journal.
    """
    call("systemctl", "enable", names.service)
    try:
        call("systemctl", "restart", names.service)
    except InstallError as error:
        journal = call("journalctl", "-u", names.service, "-n", "20", "--no-pager", "-o", "cat")
        raise InstallError(f"{error}\n{journal}") from error


def uninstall(name: str | None, say: Say) -> Names:
    """Stop the service and remove its unit; configuration, state and account stay.

    Raises
    ------
    InstallError
        Not root, or nothing of that name is installed.
    """
    need_root("beliefd service uninstall")
    names = Names.of(name)
    if not names.unit_file.exists() and not names.configuration.exists():
        raise InstallError(f"there is neither {names.unit_file} nor {names.configuration}; nothing to remove")
    if not names.unit_file.exists():
        say(f"there is no {names.unit_file}; {names.configuration} is kept unless --purge")
        return names
    call("systemctl", "disable", "--now", names.service)
    names.unit_file.unlink()
    call("systemctl", "daemon-reload")
    say(f"removed {names.unit_file}")
    return names


def purge(names: Names, say: Say) -> None:
    """Remove what :func:`uninstall` keeps; account and shared folders go with the last installation."""
    names.configuration.unlink(missing_ok=True)
    say(f"removed {names.configuration}")
    if list(names.unit_file.parent.glob("beliefd*.service")):
        return
    for folder in (CACHE, STATE, names.configuration.parent):
        shutil.rmtree(folder, ignore_errors=True)
        say(f"removed {folder}")
    call("userdel", USER)
    say(f"removed user {USER}")
