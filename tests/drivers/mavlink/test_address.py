"""URLs and ports: real sockets on loopback, a real pseudo-terminal for the serial line."""

from __future__ import annotations

import importlib.util
import os
import pty
import shutil
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from drivers.link import LinkError
from drivers.mavlink.address import open_port
from drivers.mavlink.port import PEERS, ListeningPort, Port, StreamPort, UdpPort

LOOPBACK = "127.0.0.1"


def heard(port: Port, wanted: int, seconds: float = 5.0) -> bytes:
    """Read until so many bytes have come, for a bounded time."""
    data, end = b"", time.monotonic() + seconds
    while len(data) < wanted and time.monotonic() < end:
        if port.wait(0.1):
            data += b"".join(port.read())
    return data


def opened(url: str) -> UdpPort:
    port = open_port(url)
    assert isinstance(port, UdpPort)
    return port


@pytest.mark.parametrize("scheme", ["udpin:", "udp:", ""])
def test_a_udp_server_answers_whoever_spoke(scheme: str) -> None:
    server = opened(f"{scheme}{LOOPBACK}:0")
    clients = [opened(f"udpout:{LOOPBACK}:{server.address[1]}") for _ in range(2)]
    for client in clients:
        assert client.write(b"hello")
    assert heard(server, 10) == b"hellohello"
    assert server.write(b"back")
    for client in clients:
        assert heard(client, 4) == b"back"
    for port in (server, *clients):
        port.close()


def test_so_many_peers_and_no_more() -> None:
    """Some one who speaks from ever new ports does not make us answer ever more."""
    server = opened(f"udpin:{LOOPBACK}:0")
    clients = [opened(f"udpout:{LOOPBACK}:{server.address[1]}") for _ in range(PEERS + 4)]
    for client in clients:
        client.write(b"x")
        assert heard(server, 1) == b"x"
    assert len(server._peers) == PEERS
    for port in (server, *clients):
        port.close()


def test_a_taken_port_is_refused() -> None:
    """pymavlink would share it silently, and each program would lose messages to the other."""
    server = opened(f"udpin:{LOOPBACK}:0")
    with pytest.raises(LinkError, match=r"udpin:127\.0\.0\.1:\d+: .*in use; another program has that port"):
        open_port(f"udpin:{LOOPBACK}:{server.address[1]}")
    server.close()


def test_nobody_on_the_other_side_is_no_error() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind((LOOPBACK, 0))
        address = free.getsockname()
    client = opened(f"udpout:{LOOPBACK}:{address[1]}")
    for _ in range(3):
        client.write(b"x")
        assert client.read() == []
    client.close()


def tcp_pair() -> tuple[ListeningPort, StreamPort]:
    server = open_port(f"tcpin:{LOOPBACK}:0")
    assert isinstance(server, ListeningPort)
    client = open_port(f"tcp:{LOOPBACK}:{server.address[1]}")
    assert isinstance(client, StreamPort)
    return server, client


def test_tcp_both_ways_and_the_next_client() -> None:
    server, client = tcp_pair()
    assert server.write(b"to no one")
    client.write(b"hello")
    assert heard(server, 5) == b"hello"
    assert server.write(b"back")
    assert heard(client, 4) == b"back"
    client.close()
    again = open_port(f"tcp:{LOOPBACK}:{server.address[1]}")
    again.write(b"again")
    assert heard(server, 5) == b"again"
    again.close()
    server.close()


def test_a_closed_connection_breaks_the_link() -> None:
    """pymavlink prints "EOF on TCP socket" for ever; here what came before is read, then the link breaks."""
    server, client = tcp_pair()
    client.write(b"hello")
    assert heard(server, 5) == b"hello"
    server.write(b"last words")
    server.close()
    assert heard(client, 10) == b"last words"
    assert client.wait(5.0)
    with pytest.raises(LinkError, match="closed the connection"):
        client.read()
    client.close()


VANISHING = """
import subprocess, time
from drivers.link import LinkError
from drivers.mavlink import port
from drivers.mavlink.address import open_port
port.UNANSWERED_WITHIN = 1.0
subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
server = open_port("tcpin:127.0.0.1:0")
client = open_port(f"tcp:127.0.0.1:{server.address[1]}")
assert client.write(b"hello") and server.wait(5.0) and server.read() == [b"hello"]
subprocess.run(["ip", "link", "set", "lo", "down"], check=True)
end = time.monotonic() + 30.0
broken = ""
while not (broken and server._client is None):
    assert time.monotonic() < end, "nobody noticed"
    for side in (server, client):
        side.write(b"heartbeat")
        try:
            if side.wait(0.05):
                side.read()
        except LinkError as error:
            broken = str(error)
print(broken)
"""


def test_a_peer_that_vanishes_without_a_goodbye_ends_the_connection() -> None:
    """The autopilot's power is cut: no FIN, no RST. Client and server see it, and are free for the next one."""
    namespace = ["unshare", "--map-root-user", "--net"]
    if shutil.which("unshare") is None or shutil.which("ip") is None:
        pytest.skip("unshare and ip are not installed")
    if subprocess.run([*namespace, "true"], capture_output=True, check=False).returncode != 0:
        pytest.skip("no network namespace can be made here")
    done = subprocess.run(
        [*namespace, sys.executable, "-c", VANISHING],
        cwd=Path(__file__).parents[3],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "connection" in done.stdout


def test_a_unix_socket(tmp_path: Path) -> None:
    path = str(tmp_path / "socket")
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as server:
        server.bind(path)
        server.listen(1)
        client = open_port(f"uds:{path}")
        connection, _ = server.accept()
        connection.sendall(b"hello")
        assert heard(client, 5) == b"hello"
        connection.close()
        client.close()


def test_a_serial_line() -> None:
    master, slave = pty.openpty()
    port = open_port(f"{os.ttyname(slave)},57600")
    os.write(master, b"hello")
    assert heard(port, 5) == b"hello"
    assert port.write(b"back")
    assert os.read(master, 10) == b"back"
    os.close(slave)
    os.close(master)  # the cable is pulled
    assert port.wait(5.0)
    with pytest.raises(LinkError, match="plugged in"):
        port.read()
    port.close()


@pytest.mark.parametrize(
    ("url", "complaint"),
    [
        ("udpin:127.0.0.1", "no host:port"),
        ("udpin:127.0.0.1:notaport", "no host:port"),
        ("tcp:127.0.0.1:70000", "no host:port"),
        ("udpin:192.0.2.1:14550", "not one of this machine"),
        ("tcp:127.0.0.1:1", "nobody listens there"),
        ("udpout:no.such.host.invalid:14550", "cannot be opened"),
        (f"udpout:{'x' * 64}.local:14550", "write a host's name"),
        ("/dev/no-such-device,57600", "needs a device that exists"),
        ("/dev/null,fast", "no number"),
        ("/dev/null", "serial device /dev/null"),
        ("uds:/no/such/socket", "No such file"),
        ("flight.tlog", "log file"),
        ("", "serial device"),
    ],
)
def test_what_cannot_be_opened_says_what_would_be_right(url: str, complaint: str) -> None:
    with pytest.raises(LinkError, match=complaint):
        open_port(url)


def test_a_web_socket_needs_its_package() -> None:
    if importlib.util.find_spec("wsproto") is not None:
        pytest.skip("wsproto is installed")
    with pytest.raises(LinkError, match="pip install wsproto"):
        open_port("ws:127.0.0.1:1")


@pytest.fixture
def group() -> str:
    """A multicast group on a free port."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("", 0))
        return f"mcast:239.255.145.51:{free.getsockname()[1]}"


def test_multicast_reaches_the_others(group: str) -> None:
    try:
        ports = [open_port(group) for _ in range(2)]
    except LinkError as error:
        pytest.skip(f"no multicast on this machine: {error}")
    if not ports[0].write(b"hello"):
        pytest.skip("no route for multicast on this machine")
    assert heard(ports[1], 5) == b"hello"
    for port in ports:
        port.close()
