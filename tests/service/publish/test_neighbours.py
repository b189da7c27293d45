"""Others on the same machine: a second vehicle, a stopped subscriber, a port that is taken."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator

import msgspec
import pytest
import zenoh

from service.estimate import HealthState, Status
from service.publish.session import open_embedded
from service.publish.zenoh import Publisher
from tests.service.publish.conftest import Daemon
from tests.service.publish.spoken import configured, estimate, health, tagged, wait_for

Client = Callable[[], zenoh.Session]

SUBSCRIBER = """
import json, sys, zenoh
session = zenoh.open(zenoh.Config.from_json5(json.dumps(
    {"mode": "client", "connect": {"endpoints": [sys.argv[1]]}})))
subscriber = session.declare_subscriber("beliefd/v1/**", zenoh.handlers.RingChannel(10))
print("ready", flush=True)
while True:
    subscriber.recv()
"""


class Threaded:
    """A publisher of the embedded session, stepped by a thread of the test."""

    def __init__(self, vehicle: str, endpoint: str) -> None:
        self.loop, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.publisher = Publisher(configured(vehicle), theirs, lambda: open_embedded(endpoint))
        self._theirs = theirs
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        while not self._stop.is_set():
            self.publisher.step()

    def stop(self) -> None:
        """Stop it cleanly; harmless when it is stopped."""
        if not self._stop.is_set():
            self._stop.set()
            self._thread.join(10.0)
            self.publisher.close(10.0)
            self.loop.close()
            self._theirs.close()


@pytest.fixture
def embedded(endpoint: str) -> Iterator[Callable[[str], Threaded]]:
    """Return what starts embedded publishers on one endpoint."""
    started: list[Threaded] = []

    def _start(vehicle: str) -> Threaded:
        started.append(Threaded(vehicle, endpoint))
        return started[-1]

    yield _start
    for publisher in started:
        publisher.stop()


def living(session: zenoh.Session) -> set[str]:
    """Return the vehicles that are alive."""
    replies = session.liveliness().get("beliefd/v1/*/@live", timeout=2.0)
    return {str(reply.ok.key_expr).split("/")[2] for reply in replies if reply.ok is not None}


def told(session: zenoh.Session, vehicle: str) -> Status | None:
    """Return the status of a vehicle, or nothing when it does not answer."""
    for reply in session.get(f"beliefd/v1/{vehicle}/@rpc/status", timeout=2.0):
        if reply.ok is not None:
            return msgspec.json.decode(reply.ok.payload.to_bytes(), type=Status)
    return None


def place(session: zenoh.Session, vehicle: str) -> str:
    """Return how the session of a vehicle's publisher stands."""
    status = wait_for(lambda: told(session, vehicle))
    assert isinstance(status, Status)
    assert status.publishing is not None
    return status.publishing.session


def test_a_second_vehicle_joins_the_first(
    embedded: Callable[[str], Threaded], client: Client, endpoint: str
) -> None:
    """The port is taken: it connects instead, and a client of the first sees and asks both."""
    first = embedded("mower")
    session = client()
    second = embedded("tractor")
    wait_for(lambda: living(session) == {"mower", "tractor"})
    assert place(session, "mower") == f"listening on {endpoint}"
    assert place(session, "tractor") == f"connected to {endpoint}"
    subscriber = session.declare_subscriber("beliefd/v1/*/estimate", zenoh.handlers.RingChannel(100))
    seen: set[str] = set()

    def _both() -> bool:
        first.loop.send(tagged(b"E", estimate(1)))
        second.loop.send(tagged(b"E", estimate(2)))
        while (sample := subscriber.try_recv()) is not None:
            seen.add(str(sample.key_expr))
        return len(seen) == 2

    wait_for(_both)
    assert seen == {"beliefd/v1/mower/estimate", "beliefd/v1/tractor/estimate"}


def test_the_second_takes_over_when_the_first_goes(
    embedded: Callable[[str], Threaded], client: Client, endpoint: str
) -> None:
    """Also the changes of health that it has told already are there again for late joiners."""
    first = embedded("mower")
    session = client()
    second = embedded("tractor")
    wait_for(lambda: living(session) == {"mower", "tractor"})
    second.loop.send(tagged(b"H", health(HealthState.TRACKING, "as told before")))
    wait_for(
        lambda: (
            (status := told(session, "tractor")) is not None
            and status.publishing is not None
            and status.publishing.published.get("health") == 1
        )
    )
    first.stop()
    late = client()
    assert place(late, "tractor") == f"listening on {endpoint}"
    subscriber = zenoh.ext.declare_advanced_subscriber(
        late,
        "beliefd/v1/tractor/health",
        zenoh.handlers.RingChannel(10),
        history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=50),
    )
    sample = wait_for(subscriber.try_recv)
    assert isinstance(sample, zenoh.Sample)
    assert b"as told before" in sample.payload.to_bytes()


def test_a_port_taken_by_something_else_is_said_and_tried_again(
    embedded: Callable[[str], Threaded], client: Client, port: int, caplog: pytest.LogCaptureFixture
) -> None:
    """Meanwhile the loop's datagrams are taken and counted; when the port is free, it goes on by itself."""
    with socket.socket() as squatter:
        squatter.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        squatter.bind(("127.0.0.1", port))
        squatter.listen(50)
        publisher = embedded("mower")
        wait_for(lambda: "no Zenoh session" in caplog.text)
        for sequence in range(1000):  # far more than the socket holds: somebody drains it
            with contextlib.suppress(BlockingIOError):
                publisher.loop.send(tagged(b"E", estimate(sequence)), socket.MSG_DONTWAIT)
            time.sleep(0.001)
    assert f"tcp/127.0.0.1:{port} can neither be listened on" in caplog.text
    session = client()
    status = wait_for(lambda: told(session, "mower"))
    assert isinstance(status, Status)
    assert status.publishing is not None
    assert status.publishing.unsent["estimate"] > 0
    publisher.loop.send(tagged(b"E", estimate(1)))
    wait_for(
        lambda: (
            (status := told(session, "mower")) is not None
            and status.publishing is not None
            and status.publishing.published.get("estimate")
        )
    )


def test_a_stopped_subscriber_blocks_nobody(
    start: Callable[..., Daemon], client: Client, endpoint: str
) -> None:
    """With one subscriber under SIGSTOP every estimate still reaches the other, and no datagram waits."""
    daemon = start(endpoint)
    session = client()
    with subprocess.Popen([sys.executable, "-c", SUBSCRIBER, endpoint], stdout=subprocess.PIPE) as stalled:
        try:
            assert stalled.stdout is not None
            assert stalled.stdout.readline() == b"ready\n"
            healthy = session.declare_subscriber(
                "beliefd/v1/mower/estimate", zenoh.handlers.RingChannel(5000)
            )
            wait_for(
                lambda: (daemon.send(tagged(b"E", estimate(0))), time.sleep(0.02), healthy.try_recv())[2]
            )
            os.kill(stalled.pid, signal.SIGSTOP)
            refused = 0
            cloud = b"P\x02\x00\x00\x00{}" + bytes(48_000)
            for sequence in range(1, 401):
                try:
                    daemon.send(tagged(b"E", estimate(sequence)), cloud)
                except BlockingIOError:
                    refused += 1
                time.sleep(0.005)
            got: list[int] = []

            def _last() -> bool:
                while (sample := healthy.try_recv()) is not None:
                    got.append(msgspec.json.decode(sample.payload.to_bytes())["sequence"])
                return bool(got) and got[-1] == 400

            wait_for(_last)
            assert refused == 0
            status = told(session, "mower")
            assert status is not None
            assert status.publishing is not None
            superseded = status.publishing.superseded.get("estimate", 0)
            assert len([sequence for sequence in got if sequence > 0]) >= 395 - superseded
        finally:
            stalled.kill()


def test_a_stop_is_prompt_beside_a_stopped_subscriber(
    start: Callable[..., Daemon], client: Client, endpoint: str
) -> None:
    """Zenoh's own close would wait ten seconds for the stalled one; the process leaves within its bound."""
    daemon = start(endpoint)
    client()
    with subprocess.Popen([sys.executable, "-c", SUBSCRIBER, endpoint], stdout=subprocess.PIPE) as stalled:
        try:
            assert stalled.stdout is not None
            assert stalled.stdout.readline() == b"ready\n"
            os.kill(stalled.pid, signal.SIGSTOP)
            cloud = b"P\x02\x00\x00\x00{}" + bytes(48_000)
            for _ in range(200):
                with contextlib.suppress(BlockingIOError):
                    daemon.send(cloud)
                time.sleep(0.002)
            assert daemon.stop() == 0
        finally:
            stalled.kill()


def test_a_flood_is_thinned_and_counted(start: Callable[..., Daemon], client: Client, endpoint: str) -> None:
    """While the publisher sleeps, what waits is overtaken by the newest; every datagram is accounted for."""
    daemon = start(endpoint)
    session = client()
    wait_for(lambda: told(session, "mower"))
    daemon.process.send_signal(signal.SIGSTOP)
    sent = 0
    with contextlib.suppress(BlockingIOError):
        while sent < 5000:
            daemon.send(tagged(b"E", estimate(sent)))
            sent += 1
    assert 1 < sent < 5000  # a full queue refuses: the loop counts, and is never held
    daemon.process.send_signal(signal.SIGCONT)

    def _accounted() -> Status | None:
        status = told(session, "mower")
        counts = status.publishing if status is not None else None
        done = counts and counts.published.get("estimate", 0) + counts.superseded.get("estimate", 0)
        return status if done == sent else None

    status = wait_for(_accounted)
    assert isinstance(status, Status)
    assert status.publishing is not None
    assert status.publishing.superseded["estimate"] >= sent - 2
    (reply,) = session.get("beliefd/v1/mower/@rpc/latest", timeout=2.0)
    assert reply.ok is not None
    assert msgspec.json.decode(reply.ok.payload.to_bytes())["sequence"] == sent - 1
