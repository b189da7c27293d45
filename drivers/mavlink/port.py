"""Ports by pymavlink's URLs: UDP, TCP, Unix sockets, multicast, serial lines; drained whole, never blocking.

pymavlink opens its own where a WebSocket is asked for. The others are opened here, since pymavlink binds UDP
with SO_REUSEADDR (two programs then share a port and each loses messages), prints to the terminal, sleeps
while it connects, and reports the end of a TCP connection as an endless stream of nothing.
"""

from __future__ import annotations

import contextlib
import errno
import select
import socket
import struct
import time
from typing import Any, Protocol, cast

from drivers.link import LinkError

LARGEST = 65_535
DRAIN = 512  # datagrams a time, so that what is due is done in a flood too
CONNECT_WITHIN = 2.0
UNANSWERED_WITHIN = (
    10.0  # s: a peer that lost its power says no goodbye, and TCP alone waits a quarter of an hour
)
RECEIVE_BUFFER = 1 << 20
PEER_SILENT_AFTER = 10.0
PEERS = 16
MULTICAST = ("239.255.145.50", 14550)
PASSING = (errno.EAGAIN, errno.EWOULDBLOCK, errno.ECONNREFUSED, errno.EINTR)


class Port(Protocol):
    """An open port."""

    def wait(self, timeout: float) -> bool:
        """Wait at most ``timeout`` seconds for bytes; whether there are some."""
        ...

    def read(self) -> list[bytes]:
        """Return what has arrived, in pieces; empty when nothing has.

        Raises
        ------
        LinkError
            The port has gone.
        """
        ...

    def write(self, data: bytes) -> bool:
        """Send; whether all of it was taken. Nothing waits for a peer that does not read."""
        ...

    def close(self) -> None:
        """Close; harmless when it is closed."""
        ...


class _SocketPort:
    """What all ports over one socket share."""

    def __init__(self, url: str, descriptor: socket.socket) -> None:
        self._url = url
        self._socket = descriptor
        descriptor.setblocking(False)
        with contextlib.suppress(OSError):  # the kernel's limit may be lower
            descriptor.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)

    def wait(self, timeout: float) -> bool:
        """Wait at most ``timeout`` seconds for bytes; whether there are some."""
        return bool(select.select([self._socket], [], [], max(0.0, timeout))[0])

    def close(self) -> None:
        """Close; harmless when it is closed."""
        self._socket.close()

    @property
    def address(self) -> tuple[str, int]:
        """Own host and port."""
        return cast(tuple[str, int], self._socket.getsockname()[:2])


class UdpPort(_SocketPort):
    """Datagrams. Listening, it answers whoever spoke within ten seconds; else it speaks to one address."""

    def __init__(self, url: str, descriptor: socket.socket, target: tuple[str, int] | None) -> None:
        super().__init__(url, descriptor)
        self._target = target
        self._peers: dict[Any, float] = {}

    def read(self) -> list[bytes]:
        """Return what has arrived, in pieces."""
        pieces: list[bytes] = []
        for _ in range(DRAIN):
            try:
                data, peer = self._socket.recvfrom(LARGEST)
            except OSError as error:
                if error.errno in PASSING:
                    break
                raise LinkError(f"{self._url}: {error.strerror}; is the interface up?") from error
            pieces.append(data)
            if self._target is None:
                self._remember(peer)
        return pieces

    def _remember(self, peer: Any) -> None:
        self._peers.pop(peer, None)
        self._peers[peer] = time.monotonic()
        if len(self._peers) > PEERS:
            del self._peers[next(iter(self._peers))]

    def write(self, data: bytes) -> bool:
        """Send; whether all of it was taken."""
        now = time.monotonic()
        silent = [peer for peer, heard in self._peers.items() if now - heard > PEER_SILENT_AFTER]
        for peer in silent:
            del self._peers[peer]
        targets = list(self._peers) if self._target is None else [self._target]
        sent = [self._send(data, target) for target in targets]
        return all(sent)

    def _send(self, data: bytes, target: Any) -> bool:
        try:
            return self._socket.sendto(data, target) == len(data)
        except OSError:  # no one listens there yet, or the network is away: it may come
            return False


class StreamPort(_SocketPort):
    """A connection to a server: TCP or a Unix socket."""

    def read(self) -> list[bytes]:
        """Return what has arrived, in pieces."""
        pieces: list[bytes] = []
        for _ in range(DRAIN):
            try:
                data = self._socket.recv(LARGEST)
            except OSError as error:
                if error.errno in PASSING:
                    break
                raise LinkError(f"{self._url}: connection lost: {error.strerror}") from error
            if not data:
                if pieces:
                    break
                raise LinkError(f"{self._url}: the peer has closed the connection")
            pieces.append(data)
        return pieces

    def write(self, data: bytes) -> bool:
        """Send; whether all of it was taken."""
        try:
            return self._socket.send(data) == len(data)
        except OSError:  # the next read says what is wrong
            return False


class ListeningPort(_SocketPort):
    """A TCP server for one client at a time; when it leaves, the next may come."""

    def __init__(self, url: str, descriptor: socket.socket) -> None:
        super().__init__(url, descriptor)
        self._client: StreamPort | None = None

    def wait(self, timeout: float) -> bool:
        """Wait at most ``timeout`` seconds for bytes; whether there are some."""
        return (self._client or super()).wait(timeout)

    def read(self) -> list[bytes]:
        """Return what has arrived, in pieces."""
        if self._client is None:
            try:
                connection, _ = self._socket.accept()
            except OSError:  # it went before it was accepted
                return []
            self._client = StreamPort(self._url, _attended(connection))
        try:
            return self._client.read()
        except LinkError:
            self._client.close()
            self._client = None
            return []

    def write(self, data: bytes) -> bool:
        """Send; whether all of it was taken, which is so when there is no one to take it."""
        return self._client is None or self._client.write(data)

    def close(self) -> None:
        """Close; harmless when it is closed."""
        if self._client is not None:
            self._client.close()
        super().close()


class MulticastPort(UdpPort):
    """A multicast group; what we sent ourselves is not heard."""

    def __init__(self, url: str, descriptor: socket.socket, group: tuple[str, int]) -> None:
        super().__init__(url, descriptor, group)
        self._sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._sender.setblocking(False)
        self._sender.bind(("", 0))

    def _send(self, data: bytes, target: Any) -> bool:
        try:
            return self._sender.sendto(data, target) == len(data)
        except OSError:
            return False

    def close(self) -> None:
        """Close; harmless when it is closed."""
        self._sender.close()
        super().close()


def udp_in(url: str, address: tuple[str, int]) -> Port:
    """Bind a UDP port; unlike pymavlink's it is not shared, so a port that is taken is noticed."""
    descriptor = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    descriptor.bind(address)
    return UdpPort(url, descriptor, None)


def udp_out(url: str, address: tuple[str, int]) -> Port:
    """Speak to one UDP address from a port of the system's choice."""
    target = (socket.gethostbyname(address[0]), address[1])
    return UdpPort(url, socket.socket(socket.AF_INET, socket.SOCK_DGRAM), target)


def udp_broadcast(url: str, address: tuple[str, int]) -> Port:
    """Speak to a broadcast address."""
    descriptor = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    descriptor.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
    return UdpPort(url, descriptor, address)


def tcp_client(url: str, address: tuple[str, int]) -> Port:
    """Connect to a TCP server, within two seconds."""
    return StreamPort(url, _attended(socket.create_connection(address, CONNECT_WITHIN)))


def _attended(connection: socket.socket) -> socket.socket:
    """Have what is sent leave at once, and the connection end when it is not acknowledged in time."""
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    patience = round(1e3 * UNANSWERED_WITHIN)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, patience)
    return connection


def tcp_server(url: str, address: tuple[str, int]) -> Port:
    """Listen for a TCP client."""
    descriptor = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    descriptor.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    descriptor.bind(address)
    descriptor.listen(1)
    return ListeningPort(url, descriptor)


def multicast(url: str, group: tuple[str, int]) -> Port:
    """Join a multicast group, which several programs of one host may do."""
    descriptor = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    descriptor.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    descriptor.bind(group)
    membership = struct.pack("4sl", socket.inet_aton(group[0]), socket.INADDR_ANY)
    descriptor.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
    return MulticastPort(url, descriptor, group)


def unix_client(url: str, path: str) -> Port:
    """Connect to a Unix stream socket."""
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    connection.settimeout(CONNECT_WITHIN)
    connection.connect(path)
    return StreamPort(url, connection)
