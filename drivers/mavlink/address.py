"""From a URL as pymavlink writes it to an open port."""

from __future__ import annotations

import errno
import select
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

from drivers.link import LinkError
from drivers.mavlink.port import (
    MULTICAST,
    Port,
    multicast,
    tcp_client,
    tcp_server,
    udp_broadcast,
    udp_in,
    udp_out,
    unix_client,
)
from drivers.mavlink.serial_port import open_serial

Opener = Callable[[str, tuple[str, int]], Port]
BY_ADDRESS: dict[str, Opener] = {
    "udpin": udp_in,
    "udp": udp_in,
    "udpout": udp_out,
    "udpbcast": udp_broadcast,
    "tcp": tcp_client,
    "tcpin": tcp_server,
    "mcast": multicast,
}
UNIX = ("uds", "unix")
WEB = ("ws", "wss", "wsserver")
LOGS = (".tlog", ".bin", ".log", ".ulg")
WHAT_IS_RIGHT = {
    errno.EADDRINUSE: "another program has that port: stop it, or give this link another port",
    errno.EADDRNOTAVAIL: "that address is not one of this machine; 0.0.0.0 listens on all of them",
    errno.EACCES: "ports below 1024 need a right that this program does not have",
    errno.ECONNREFUSED: "nobody listens there (yet)",
}


def open_port(url: str) -> Port:
    """Open what a URL names.

    Parameters
    ----------
    url : str
        ``udpin:host:port``, ``udp:host:port`` (the same), ``udpout:…``, ``udpbcast:…``, ``tcp:…``,
        ``tcpin:…``, ``mcast:`` or ``mcast:group:port``, ``uds:path``, ``ws:…``, ``host:port`` (UDP,
        listening), or a serial device, ``/dev/ttyS1`` or ``/dev/ttyS1,57600``.

    Raises
    ------
    LinkError
        The URL is not one of these, or what it names cannot be opened; says which and what would be right.
    """
    scheme, _, rest = url.partition(":")
    try:
        if scheme in BY_ADDRESS:
            return BY_ADDRESS[scheme](url, _address(url, scheme, rest))
        if scheme in UNIX:
            return unix_client(url, rest)
        if scheme in WEB:
            return WebPort(url)
        if Path(url).suffix in LOGS:
            raise LinkError(f"{url}: is a log file; a link needs a live port (a log is for 'beliefd replay')")
        if rest and not Path(url.partition(",")[0]).exists():
            return udp_in(url, _address(url, "udpin", url))
        return open_serial(url)
    except OSError as error:
        right = WHAT_IS_RIGHT.get(error.errno or 0, "check the host, the port and the network")
        raise LinkError(f"{url}: cannot be opened: {error.strerror or error}; {right}") from error
    except ValueError as error:  # a name that is none, its labels too long
        raise LinkError(f"{url}: cannot be opened: {error}; write a host's name or address") from error


def _address(url: str, scheme: str, text: str) -> tuple[str, int]:
    if scheme == "mcast" and ":" not in text:
        text = f"{MULTICAST[0]}:{text or MULTICAST[1]}"
    host, colon, port = text.rpartition(":")
    if not colon or not host or not port.isdigit() or int(port) > 65_535:
        raise LinkError(f"{url}: '{text}' is no host:port; write it as {scheme}:127.0.0.1:14550")
    return host, int(port)


class WebPort:
    """A WebSocket, which pymavlink opens; it needs the package wsproto.

    Raises
    ------
    LinkError
        It cannot be opened.
    """

    def __init__(self, url: str) -> None:
        from pymavlink import mavutil  # only here: it opens what it likes and prints

        self._url = url
        try:
            self._connection: Any = cast(Any, mavutil).mavlink_connection(url)
        except ImportError as error:
            raise LinkError(f"{url}: WebSockets need the package wsproto: pip install wsproto") from error

    def wait(self, timeout: float) -> bool:
        """Wait at most ``timeout`` seconds for bytes; whether there are some."""
        return bool(select.select([self._connection.fd], [], [], max(0.0, timeout))[0])

    def read(self) -> list[bytes]:
        """Return what has arrived.

        Raises
        ------
        LinkError
            The connection is lost.
        """
        try:
            data = bytes(self._connection.recv() or b"")
        except (OSError, ValueError) as error:
            raise LinkError(f"{self._url}: connection lost: {error}") from error
        return [data] if data else []

    def write(self, data: bytes) -> bool:
        """Send; whether it was taken."""
        try:
            self._connection.write(data)
        except (OSError, ValueError):
            return False
        return True

    def close(self) -> None:
        """Close; harmless when it is closed."""
        self._connection.close()
