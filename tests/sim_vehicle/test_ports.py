"""Ports on real sockets and buses: both directions, drops counted, refusals that say what would be right."""

from __future__ import annotations

import contextlib
import select
import socket
import uuid
from collections.abc import Iterator

import can
import pytest

from sim_vehicle.frame import CanFrame
from sim_vehicle.ports import LARGEST_AUDIENCE, MavlinkPort, PortError, open_can, open_mavlink


@contextlib.contextmanager
def opened(url: str) -> Iterator[tuple[MavlinkPort, int]]:
    port = open_mavlink(url)
    try:
        yield port, int(port.address.rpartition(":")[2])
    finally:
        port.close()


def heard(port: MavlinkPort) -> bytes:
    """Return what comes next; waited for at most 5 s."""
    for _ in range(100):
        select.select(port.filenos(), [], [], 0.05)
        if data := port.receive():
            return b"".join(data)
    raise AssertionError("nothing came in 5 s")


def test_udpout_sends_to_its_place_and_hears_the_answer() -> None:
    with contextlib.closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as listener:
        listener.bind(("127.0.0.1", 0))
        listener.settimeout(5.0)
        with opened(f"udpout:127.0.0.1:{listener.getsockname()[1]}") as (port, _):
            port.send(b"hello")
            data, peer = listener.recvfrom(100)
            listener.sendto(b"answer", peer)
            assert (data, heard(port), port.dropped) == (b"hello", b"answer", 0)


def test_udpout_goes_on_when_nobody_listens() -> None:
    with contextlib.closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as closed:
        closed.bind(("127.0.0.1", 0))
        place = closed.getsockname()[1]
    with opened(f"udpout:127.0.0.1:{place}") as (port, _):
        for _ in range(10):
            port.send(b"anyone?")
            assert port.receive() == []


def test_udpin_waits_until_it_is_spoken_to() -> None:
    with (
        opened("udpin:127.0.0.1:0") as (port, number),
        contextlib.closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as client,
    ):
        client.settimeout(5.0)
        port.send(b"lost")
        assert port.dropped == 1
        client.sendto(b"hello", ("127.0.0.1", number))
        assert heard(port) == b"hello"
        port.send(b"found")
        assert client.recv(100) == b"found"


def test_udpin_sends_to_the_last_who_spoke_and_forgets_the_first() -> None:
    with opened("udpin:127.0.0.1:0") as (port, number), contextlib.ExitStack() as clients:
        sockets: list[socket.socket] = []
        for _ in range(LARGEST_AUDIENCE + 1):
            client = clients.enter_context(
                contextlib.closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            )
            client.settimeout(5.0)
            client.sendto(b"hello", ("127.0.0.1", number))
            assert heard(port) == b"hello"
            sockets.append(client)
        port.send(b"news")
        assert all(client.recv(100) == b"news" for client in sockets[1:])
        sockets[0].setblocking(False)
        with pytest.raises(BlockingIOError):
            sockets[0].recv(100)


def test_tcpin_serves_one_client_after_another() -> None:
    with opened("tcpin:127.0.0.1:0") as (port, number):
        port.send(b"lost")
        assert port.dropped == 1
        for greeting in (b"first", b"second"):
            with contextlib.closing(socket.create_connection(("127.0.0.1", number), timeout=5.0)) as client:
                client.sendall(greeting)
                assert heard(port) == greeting
                port.send(b"frame")
                assert client.recv(100) == b"frame"


def test_a_tcp_client_that_does_not_read_blocks_nothing() -> None:
    with opened("tcpin:127.0.0.1:0") as (port, number):
        with contextlib.closing(socket.create_connection(("127.0.0.1", number), timeout=5.0)) as client:
            client.sendall(b"hello")
            heard(port)
            for _ in range(20_000):
                port.send(bytes(280))
            assert port.dropped > 0
        port.receive()
        port.receive()
        before = port.dropped
        port.send(b"gone")
        assert port.dropped == before + 1


@pytest.mark.parametrize(
    "url", ["", "udp:127.0.0.1:14550", "udpin:14550", "udpin:127.0.0.1:x", "udpin:127.0.0.1:70000"]
)
def test_a_url_of_another_kind_is_refused(url: str) -> None:
    with pytest.raises(PortError, match="needs udpout:HOST:PORT, udpin:HOST:PORT or tcpin:HOST:PORT"):
        open_mavlink(url)


class Down(can.BusABC):
    """A bus whose interface has been taken down."""

    def __init__(self, channel: str, **_settings: object) -> None:
        super().__init__(channel)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        raise can.CanOperationError("Failed to transmit: Network is down", 100)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        raise can.CanOperationError("Error receiving: Network is down", 100)


def test_a_bus_that_goes_down_while_driving_is_no_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """The frames that nobody takes are counted, and said when the drive is over."""
    monkeypatch.setitem(can.interfaces.BACKENDS, "socketcan", (__name__, "Down"))
    port = open_can("socketcan:vcan0")
    for _ in range(3):
        port.serve()
        port.send(CanFrame(0x18042F7B, b"1234567"))
    assert (port.dropped, port.received) == (3, 0)
    port.close()


def test_a_taken_port_is_refused() -> None:
    with (
        opened("udpin:127.0.0.1:0") as (_, number),
        pytest.raises(PortError, match="choose another port or stop who has it"),
    ):
        open_mavlink(f"udpin:127.0.0.1:{number}")


def test_a_bus_of_python_can_carries_the_frames_both_ways() -> None:
    channel = f"sim-{uuid.uuid4()}"
    port = open_can(f"virtual:{channel}")
    with can.Bus(interface="virtual", channel=channel) as other:
        port.send(CanFrame(0x1004172A, b"\x01\x02"))
        message = other.recv(timeout=5.0)
        assert message is not None
        assert (message.arbitration_id, message.is_extended_id, bytes(message.data)) == (
            0x1004172A,
            True,
            b"\x01\x02",
        )
        other.send(can.Message(arbitration_id=1, data=b"x"))
        port.serve()
        assert (port.received, port.dropped) == (1, 0)
    port.close()


@pytest.mark.parametrize(
    ("where", "complaint"),
    [
        ("socketcan:", "needs INTERFACE:CHANNEL"),
        ("nosuchcan9", "--can nosuchcan9: "),
        ("nosuch:can0", "nosuch"),
        ("socketcan:nosuchcan9", "--can socketcan:nosuchcan9: "),
    ],
)
def test_a_bus_that_cannot_be_opened_is_refused(where: str, complaint: str) -> None:
    with pytest.raises(PortError, match=complaint):
        open_can(where)
