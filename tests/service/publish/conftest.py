"""A publishing process on a port of its own, and clients to look at it."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
import zenoh

from tests.service.publish.spoken import wait_for

PROGRAM = """
import logging, socket, sys
from service.config import load
from service.publish.zenoh import run
logging.basicConfig(level="INFO", stream=sys.stderr)
run(load(sys.argv[1]), socket.socket(fileno=int(sys.argv[2])))
"""


@pytest.fixture
def port() -> Iterator[int]:
    """Return a port that the system chose, reserved as long as the test runs, but free to be listened on."""
    with socket.socket() as placeholder:
        placeholder.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        placeholder.bind(("127.0.0.1", 0))
        yield placeholder.getsockname()[1]


@pytest.fixture
def endpoint(port: int) -> str:
    """Return that port as Zenoh writes it."""
    return f"tcp/127.0.0.1:{port}"


@pytest.fixture
def client(endpoint: str) -> Iterator[Callable[[], zenoh.Session]]:
    """Return what opens clients of ``endpoint``; they are closed with the test."""
    sessions: list[zenoh.Session] = []

    def _open() -> zenoh.Session:
        configuration = {
            "mode": "client",
            "connect": {"endpoints": [endpoint]},
            "scouting": {"multicast": {"enabled": False}},
        }

        def _try() -> zenoh.Session | None:
            try:
                return zenoh.open(zenoh.Config.from_json5(json.dumps(configuration)))
            except zenoh.ZError:
                return None

        session = wait_for(_try)
        assert isinstance(session, zenoh.Session)
        sessions.append(session)
        return session

    yield _open
    for session in sessions:
        with contextlib.suppress(zenoh.ZError):
            session.close()


@dataclass
class Daemon:
    """A publishing process and the loop's end of its socket pair."""

    loop: socket.socket
    process: subprocess.Popen[str]
    log: Path
    sent: int = field(default=0)

    def send(self, *datagrams: bytes) -> None:
        """Send datagrams as the loop does, without waiting."""
        for datagram in datagrams:
            self.loop.send(datagram, socket.MSG_DONTWAIT)

    def stop(self) -> int:
        """Stop it as the supervisor does, and return its exit status."""
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(5.0)


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Daemon]]:
    """Return what starts publishing processes; what still runs is killed with the test."""
    daemons: list[Daemon] = []

    def _start(endpoint: str, vehicle: str = "mower", *, connect: bool = False) -> Daemon:
        links = {"connect": {"endpoints": [endpoint]}, "listen": {"endpoints": ["tcp/127.0.0.1:0"]}}
        session = tmp_path / f"{vehicle}.json5"
        session.write_text(
            json.dumps(
                {
                    "mode": "peer",
                    **(links if connect else {"listen": {"endpoints": [endpoint]}}),
                    "scouting": {"multicast": {"enabled": False}},
                    "transport": {"shared_memory": {"enabled": False}},
                }
            )
        )
        file = tmp_path / f"{vehicle}.toml"
        file.write_text(
            f'[vehicle]\nname = "{vehicle}"\n'
            '[[link]]\nname = "autopilot"\nkind = "mavlink"\nurl = "udpin:127.0.0.1:14550"\n'
            f'[publish]\nzenoh = "{session}"\n'
        )
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        log = tmp_path / f"{vehicle}.log"
        with log.open("w") as stderr:
            process = subprocess.Popen(
                [sys.executable, "-c", PROGRAM, str(file), str(theirs.fileno())],
                pass_fds=[theirs.fileno()],
                stderr=stderr,
                text=True,
            )
        theirs.close()
        daemon = Daemon(ours, process, log)
        daemons.append(daemon)
        return daemon

    yield _start
    for daemon in daemons:
        daemon.loop.close()
        if daemon.process.poll() is None:
            os.kill(daemon.process.pid, signal.SIGCONT)
            daemon.process.kill()
            daemon.process.wait(5.0)
