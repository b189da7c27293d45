"""Where the frames go in real time: UDP and TCP for MAVLink, python-can or a serial adapter for the bus.

Nothing here blocks: a frame that nobody takes is dropped and counted.
"""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Callable
from typing import Protocol

import can

from sim_vehicle.frame import CanFrame
from sim_vehicle.slcan import Adapter

LARGEST_DATAGRAM = 65_535
SOCKETCAN = "socketcan"
LARGEST_AUDIENCE = 8
"""UDP peers that are sent to; whoever spoke longest ago makes room for a new one."""
LARGEST_BACKLOG = 65_536
"""Bytes that a slow TCP client may leave unread before frames are dropped."""


class PortError(Exception):
    """A port cannot be opened; the text says which, why, and what would be right."""


class MavlinkPort(Protocol):
    """Where MAVLink bytes go, and where the companions' come from."""

    address: str
    dropped: int

    def filenos(self) -> list[int]:
        """Return the descriptors to wait on."""
        ...

    def send(self, frame: bytes) -> None:
        """Send one frame, or drop and count it."""
        ...

    def receive(self) -> list[bytes]:
        """Return what has arrived since the last call."""
        ...

    def close(self) -> None:
        """Close it."""
        ...


class _Udp:
    """The part that both directions of UDP share."""

    def __init__(self) -> None:
        self.dropped = 0
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def filenos(self) -> list[int]:
        """Return the descriptors to wait on."""
        return [self._socket.fileno()]

    def close(self) -> None:
        """Close it."""
        self._socket.close()

    def _send_to(self, frame: bytes, peer: tuple[str, int]) -> None:
        try:
            self._socket.sendto(frame, peer)
        except OSError:
            self.dropped += 1

    def _receive_from(self) -> list[tuple[bytes, tuple[str, int]]]:
        arrived: list[tuple[bytes, tuple[str, int]]] = []
        while True:
            try:
                arrived.append(self._socket.recvfrom(LARGEST_DATAGRAM))
            except ConnectionRefusedError:
                continue
            except OSError:
                return arrived


class UdpClient(_Udp):
    """``udpout:HOST:PORT``: sends to one place, and hears what that answers."""

    def __init__(self, host: str, port: int) -> None:
        super().__init__()
        self._peer = (host, port)
        self.address = f"udpout:{host}:{port}"

    def send(self, frame: bytes) -> None:
        """Send one frame, or drop and count it."""
        self._send_to(frame, self._peer)

    def receive(self) -> list[bytes]:
        """Return what has arrived since the last call."""
        return [data for data, _peer in self._receive_from()]


class UdpServer(_Udp):
    """``udpin:HOST:PORT``: waits until somebody speaks, then sends to everybody who has."""

    def __init__(self, host: str, port: int) -> None:
        super().__init__()
        self._socket.bind((host, port))
        self._peers: dict[tuple[str, int], None] = {}
        self.address = f"udpin:{host}:{self._socket.getsockname()[1]}"

    def send(self, frame: bytes) -> None:
        """Send one frame to every peer; without any it is dropped and counted."""
        if not self._peers:
            self.dropped += 1
        for peer in self._peers:
            self._send_to(frame, peer)

    def receive(self) -> list[bytes]:
        """Return what has arrived since the last call."""
        arrived = self._receive_from()
        for _data, peer in arrived:
            self._peers[peer] = self._peers.pop(peer, None)
        for silent in list(self._peers)[:-LARGEST_AUDIENCE]:
            del self._peers[silent]
        return [data for data, _peer in arrived]


class TcpServer:
    """``tcpin:HOST:PORT``: one client at a time; a later one takes the place of the earlier."""

    def __init__(self, host: str, port: int) -> None:
        self._listening = socket.create_server((host, port))
        self._listening.setblocking(False)
        self._client: socket.socket | None = None
        self._backlog = bytearray()
        self.dropped = 0
        self.address = f"tcpin:{host}:{self._listening.getsockname()[1]}"

    def filenos(self) -> list[int]:
        """Return the descriptors to wait on."""
        return [self._listening.fileno(), *([self._client.fileno()] if self._client else [])]

    def send(self, frame: bytes) -> None:
        """Send one frame, or drop and count it when nobody is there or the client is too slow."""
        if self._client is None or len(self._backlog) + len(frame) > LARGEST_BACKLOG:
            self.dropped += 1
            return
        self._backlog += frame
        try:
            del self._backlog[: self._client.send(self._backlog)]
        except BlockingIOError:
            return
        except OSError:
            self._hang_up()

    def receive(self) -> list[bytes]:
        """Return what has arrived since the last call."""
        with contextlib.suppress(BlockingIOError, ConnectionAbortedError):
            client, _peer = self._listening.accept()
            self._hang_up()
            client.setblocking(False)
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._client = client
        if self._client is None:
            return []
        try:
            data = self._client.recv(LARGEST_DATAGRAM)
        except BlockingIOError:
            return []
        except OSError:
            data = b""
        if not data:
            self._hang_up()
            return []
        return [data]

    def close(self) -> None:
        """Close it."""
        self._hang_up()
        self._listening.close()

    def _hang_up(self) -> None:
        if self._client is not None:
            self._client.close()
        self._client = None
        self._backlog.clear()


_KINDS: dict[str, Callable[[str, int], MavlinkPort]] = {
    "udpout": UdpClient,
    "udpin": UdpServer,
    "tcpin": TcpServer,
}


def open_mavlink(url: str) -> MavlinkPort:
    """Open a MAVLink port.

    Parameters
    ----------
    url : str
        ``udpout:HOST:PORT``, ``udpin:HOST:PORT`` or ``tcpin:HOST:PORT``; port 0: the system chooses one.

    Raises
    ------
    PortError
        The URL is none of these, or the port is taken.
    """
    kind, _, rest = url.partition(":")
    host, _, port = rest.rpartition(":")
    if kind not in _KINDS or not host or not port.isdigit() or int(port) > 65_535:
        raise PortError(f"--mavlink {url}: needs udpout:HOST:PORT, udpin:HOST:PORT or tcpin:HOST:PORT")
    try:
        return _KINDS[kind](host, int(port))
    except OSError as error:
        raise PortError(
            f"--mavlink {url}: {error.strerror or error}; choose another port or stop who has it"
        ) from error


class CanPort(Protocol):
    """Where CAN frames go, and where those of others come from."""

    address: str
    dropped: int
    received: int

    def filenos(self) -> list[int]:
        """Return the descriptors to wait on."""
        ...

    def send(self, frame: CanFrame) -> None:
        """Send one frame, or drop and count it."""
        ...

    def serve(self) -> None:
        """Do what the port owes its peer: take in what has arrived, answer it."""
        ...

    def close(self) -> None:
        """Close it."""
        ...


class BusPort:
    """A bus that python-can opens: ``socketcan:vcan0``, ``virtual:NAME``."""

    def __init__(self, interface: str, channel: str) -> None:
        self._bus = can.Bus(interface=interface, channel=channel)
        self.address = f"{interface}:{channel}"
        self.dropped = 0
        self.received = 0

    def filenos(self) -> list[int]:
        """Return the descriptors to wait on: none where the interface has none."""
        try:
            return [self._bus.fileno()]
        except NotImplementedError:
            return []

    def send(self, frame: CanFrame) -> None:
        """Send one frame, or drop and count it."""
        message = can.Message(
            arbitration_id=frame.identifier, is_extended_id=frame.extended, data=bytearray(frame.data)
        )
        try:
            self._bus.send(message, timeout=0.0)
        except can.CanError:
            self.dropped += 1

    def serve(self) -> None:
        """Take in what others have sent: the vehicle's nodes count it and want nothing of it.

        A bus that has gone down is not an end: its frames count as dropped until it is up again.
        """
        with contextlib.suppress(can.CanError):
            while self._bus.recv(timeout=0.0) is not None:
                self.received += 1

    def close(self) -> None:
        """Close it."""
        self._bus.shutdown()


def bus_of(where: str) -> tuple[str, str]:
    """Return interface and channel of ``INTERFACE:CHANNEL``, or of a channel of SocketCAN alone."""
    interface, colon, channel = where.partition(":")
    return (interface, channel) if colon else (SOCKETCAN, where)


def open_can(where: str) -> CanPort:
    """Open the bus.

    Parameters
    ----------
    where : str
        ``INTERFACE:CHANNEL``, or a channel of SocketCAN alone; with ``slcan:PATH`` the simulator is the serial
        adapter, and PATH leads to its port.

    Raises
    ------
    PortError
        There is no such interface, or it cannot be opened.
    """
    interface, channel = bus_of(where)
    if not interface or not channel:
        raise PortError(f"--can {where}: needs INTERFACE:CHANNEL, as socketcan:vcan0 or slcan:/tmp/can0")
    try:
        return Adapter(channel) if interface == "slcan" else BusPort(interface, channel)
    except (OSError, can.CanError, ValueError) as error:
        raise PortError(f"--can {where}: {error}") from error
