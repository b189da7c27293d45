"""How an installed service stands: what systemd knows of it, and what it says of itself on Zenoh."""

from __future__ import annotations

import msgspec
from rich.console import Console
from rich.table import Table

from service.config import Configuration, ConfigurationError, load
from service.estimate import Status
from service.install.system import InstallError, call
from service.install.unit import Names

_PROPERTIES = {
    "ActiveState": "state",
    "SubState": "in detail",
    "MainPID": "process",
    "NRestarts": "restarts by systemd",
    "ActiveEnterTimestamp": "since",
    "StatusText": "says",
}
_MEBIBYTE = 2**20
_ANSWER_SECONDS = 2.0


def properties(names: Names) -> dict[str, str]:
    """Return what systemd says of the unit, by property.

    Raises
    ------
    InstallError
        There is no such unit, or no systemd.
    """
    if not names.unit_file.exists():
        raise InstallError(f"there is no {names.unit_file}: sudo beliefd service install CONFIG")
    said = call("systemctl", "show", "-p", ",".join(_PROPERTIES), names.service)
    return dict(line.split("=", 1) for line in said.splitlines() if "=" in line)


def answer(configuration: Configuration) -> Status | None:
    """Ask the daemon for ``@rpc/status``; None when nobody answers within two seconds.

    Raises
    ------
    InstallError
        There is no Zenoh session to be had where the configuration says.
    """
    from service.publish import session as sessions
    from service.publish.topics import STATUS, Keys

    own = configuration.publish.zenoh
    try:
        session = sessions.open_from_file(own).session if own else sessions.open_client(sessions.LOOPBACK)
    except sessions.SessionError as error:
        raise InstallError(f"zenoh: {error}") from error
    try:
        keys = Keys(configuration.publish.prefix, configuration.vehicle.name)
        for reply in session.get(keys.of(STATUS), timeout=_ANSWER_SECONDS):
            if reply.ok is not None:
                return msgspec.json.decode(reply.ok.payload.to_bytes(), type=Status)
        return None
    finally:
        sessions.close(session, _ANSWER_SECONDS)


def _unit_table(names: Names, found: dict[str, str]) -> Table:
    table = Table(title=names.service, title_justify="left", show_header=False)
    for key, words in _PROPERTIES.items():
        table.add_row(words, found.get(key, ""))
    return table


def _status_table(status: Status) -> Table:
    table = Table("process", "pid", "state", "restarts", "MiB", "why", title_justify="left")
    health = status.health
    table.title = f"{status.vehicle}: {health.state.value}, {health.reason}" if health else status.vehicle
    for process in status.processes:
        held = process.resident_bytes
        table.add_row(
            process.name,
            str(process.pid or ""),
            process.state,
            str(process.restarts),
            "" if held is None else f"{held / _MEBIBYTE:.0f}",
            process.reason,
        )
    return table


def show(name: str | None) -> int:
    """Print how the service stands; return 0 when it runs and answers, else 1."""
    console = Console(highlight=False)
    names = Names.of(name)
    found = properties(names)
    console.print(_unit_table(names, found))
    if found.get("ActiveState") != "active":
        return 1
    try:
        status = answer(load(names.configuration))
    except (ConfigurationError, InstallError) as error:
        console.print(f"no answer: {error}", soft_wrap=True, markup=False)
        return 1
    if status is None:
        console.print(f"no answer to @rpc/status within {_ANSWER_SECONDS:g} s")
        return 1
    console.print(_status_table(status))
    return 0
