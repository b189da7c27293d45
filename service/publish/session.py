"""Opening and closing Zenoh sessions: loopback, no multicast scouting, no shared memory, bounded in time.

Without a file of the user's the first daemon on a machine is the *hub*: a peer that listens on
``tcp/127.0.0.1:7447``. A second one finds the port taken, connects to the hub and listens on a port of
its own that gossip makes known; peers then connect directly, and clients of the hub see both. When the
hub goes, one of the others takes the port over (:meth:`Opened.orphaned`).
"""

from __future__ import annotations

import json
import re
import socket
import threading
from dataclasses import dataclass
from pathlib import Path

import zenoh

LOOPBACK = "tcp/127.0.0.1:7447"

_CONNECT_MS = 1000


class SessionError(Exception):
    """No session; the text says what was tried and what would be right."""


@dataclass(frozen=True)
class Opened:
    """A session, how it stands in words, and the hub it depends on, if it does."""

    session: zenoh.Session
    place: str
    hub: str | None = None

    def orphaned(self) -> bool:
        """Tell whether the hub has gone and left its port free to be taken over."""
        if self.hub is None or any(str(link.dst) == self.hub for link in self.session.info.links()):
            return False
        return _bindable(self.hub)


def configuration_from_file(path: str) -> zenoh.Config:
    """Return what a JSON5 file says.

    The file is taken as it is but for one thing: time stamps are switched on unless it says otherwise,
    because the history of ``health`` needs them.

    Raises
    ------
    SessionError
        The file cannot be read, or is no Zenoh configuration.
    """
    if not Path(path).is_file():
        raise SessionError(
            f"publish.zenoh: {path} is not a file; it should be a Zenoh JSON5 configuration, or empty"
        )
    try:
        configuration = zenoh.Config.from_file(path)
        if json.loads(configuration.get_json("timestamping/enabled")) is None:
            configuration.insert_json5("timestamping/enabled", "true")
    except zenoh.ZError as error:
        raise SessionError(f"publish.zenoh: {path}: {plain(error)}") from error
    return configuration


def open_from_file(path: str) -> Opened:
    """Open a session as a JSON5 file says.

    Raises
    ------
    SessionError
        The file cannot be read, is no Zenoh configuration, or its endpoints cannot be had.
    """
    configuration = configuration_from_file(path)
    try:
        return Opened(zenoh.open(configuration), f"as {path} says")
    except zenoh.ZError as error:
        raise SessionError(f"publish.zenoh: {path}: {plain(error)}") from error


def open_embedded(endpoint: str = LOOPBACK) -> Opened:
    """Open the embedded peer: listening on ``endpoint``, or connected to whoever listens there already.

    Raises
    ------
    SessionError
        The port is taken by something that does not speak Zenoh, or cannot be bound at all.
    """
    try:
        return Opened(zenoh.open(_peer(listen=endpoint)), f"listening on {endpoint}")
    except zenoh.ZError as error:
        busy = plain(error)
    try:
        session = zenoh.open(_peer(listen="tcp/127.0.0.1:0", connect=endpoint))
    except zenoh.ZError as error:
        raise SessionError(
            f"{endpoint} can neither be listened on ({busy}) nor connected to ({plain(error)}); "
            "free the port, or name a Zenoh configuration file in publish.zenoh"
        ) from error
    return Opened(session, f"connected to {endpoint}", hub=endpoint)


def open_client(endpoint: str) -> zenoh.Session:
    """Open a client of the daemon or router at ``endpoint``, as ``listen`` and the demonstration do.

    Raises
    ------
    SessionError
        Nobody answers there, or the endpoint is not one.
    """
    try:
        return zenoh.open(_configuration(mode="client", connect={"endpoints": [endpoint]}))
    except zenoh.ZError as error:
        raise SessionError(f"{endpoint}: {plain(error)}") from error


def close(session: zenoh.Session, seconds: float) -> bool:
    """Close a session, but wait no longer than ``seconds``; tell whether it is closed.

    ``Session.close`` can take ten seconds and then raise when a peer is stalled. It goes on in a daemon
    thread when it is late: whoever gets ``False`` must leave by :func:`os._exit`.
    """
    closed = threading.Event()

    def _close() -> None:
        try:
            session.close()
        except zenoh.ZError:
            return
        closed.set()

    threading.Thread(target=_close, name="zenoh close", daemon=True).start()
    return closed.wait(seconds)


def plain(error: zenoh.ZError) -> str:
    """Return the text of an error without the places in Zenoh's own sources."""
    return re.sub(r"\s*at /\S+\.rs:\d+\.?", "", str(error)).strip()


def _peer(listen: str, connect: str | None = None) -> zenoh.Config:
    links: dict[str, object] = {"listen": {"endpoints": [listen]}}
    if connect is not None:
        links["connect"] = {"endpoints": [connect], "exit_on_failure": True, "timeout_ms": _CONNECT_MS}
    return _configuration(mode="peer", **links)


def _configuration(**settings: object) -> zenoh.Config:
    return zenoh.Config.from_json5(
        json.dumps(
            {
                "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": True}},
                "transport": {"shared_memory": {"enabled": False}},
                "timestamping": {"enabled": True},
                **settings,
            }
        )
    )


def _bindable(endpoint: str) -> bool:
    host, _, port = endpoint.removeprefix("tcp/").rpartition(":")
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, int(port)))
        except OSError:
            return False
    return True
