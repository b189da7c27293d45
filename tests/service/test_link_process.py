"""One link's process around a real UDP link of the test's own, in a thread or in a real process."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterator

import pytest

from drivers.link import LinkError
from drivers.sample import LinkReport, Sample, SampleBatch, Speed, decode
from service.channels import Heart, Pair, pair, undertaking
from service.link_process import LinkProcess

PATIENCE = 10.0


class StopTest(BaseException):
    """Ends a link process as SIGTERM does: an exception out of poll."""


class UdpLink:
    """A small real link: each datagram is one speed in text."""

    def __init__(self, port: int = 0) -> None:
        self.port = port
        self.socket: socket.socket | None = None
        self.stop = False
        self.broken = ""
        self.samples = 0
        self.malformed = 0
        self.closed = 0
        self.opened = 0

    def open(self) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self.socket.bind(("127.0.0.1", self.port))
        except OSError as error:
            raise LinkError(f"port {self.port} is taken: {error.strerror}; stop the other program") from error
        self.port = self.socket.getsockname()[1]
        self.opened += 1

    def poll(self, timeout: float) -> list[Sample]:
        if self.stop:
            raise StopTest
        if self.broken:
            reason, self.broken = self.broken, ""
            raise LinkError(reason)
        assert self.socket is not None
        self.socket.settimeout(timeout)
        try:
            data = self.socket.recv(2048)
        except TimeoutError:
            return []
        try:
            speeds = [float(word) for word in data.split()]
        except ValueError:
            self.malformed += 1
            return []
        now = time.monotonic_ns()
        self.samples += len(speeds)
        return [Sample(now, now, "wheels", "text", Speed(speed)) for speed in speeds]

    def report(self) -> LinkReport:
        return LinkReport(
            "?",
            "up" if self.samples else "silent",
            samples=self.samples,
            malformed={"text": self.malformed} if self.malformed else {},
        )

    def close(self) -> None:
        self.closed += 1
        if self.socket is not None:
            self.socket.close()


class Rig:
    """A link process in a thread, and the two far ends of its queues."""

    def __init__(self, link: UdpLink, room: int = 256 * 1024) -> None:
        self.link = link
        self.samples: Pair = pair(room)
        self.heart: Pair = pair(16 * 1024)
        self.reports: list[LinkReport] = []
        self.speeds: list[float] = []
        self.process = LinkProcess("wheels", link, self.samples.outlet, Heart(self.heart.outlet))
        self.thread = threading.Thread(target=self._run)
        self.thread.start()

    def _run(self) -> None:
        with pytest.raises(StopTest):
            self.process.run()

    def read(self) -> None:
        while True:
            try:
                datagram = decode(self.samples.inlet.recv(65536))
            except BlockingIOError:
                return
            if isinstance(datagram, SampleBatch):
                self.speeds += [s.reading.speed for s in datagram.samples if isinstance(s.reading, Speed)]
            else:
                self.reports.append(datagram)

    def wait(self, condition: Callable[[], bool]) -> None:
        until = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < until, (self.reports, self.speeds)
            self.samples.inlet.settimeout(0.1)
            try:
                self.samples.inlet.recv(1, socket.MSG_PEEK)
            except TimeoutError:
                pass
            finally:
                self.samples.inlet.setblocking(False)
            self.read()

    def states(self) -> list[str]:
        return [report.state for report in self.reports]

    def beats(self) -> list[str | None]:
        heard: list[str | None] = []
        while True:
            try:
                heard.append(undertaking(self.heart.inlet.recv(256)))
            except BlockingIOError:
                return heard

    def close(self) -> None:
        self.link.stop = True
        self.thread.join(PATIENCE)
        assert not self.thread.is_alive()
        self.samples.close()
        self.heart.close()


@pytest.fixture
def sender() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as end:
        yield end


@pytest.fixture
def rigs() -> Iterator[Callable[..., Rig]]:
    made: list[Rig] = []

    def make(link: UdpLink, room: int = 256 * 1024) -> Rig:
        made.append(Rig(link, room))
        return made[-1]

    yield make
    for rig in made:
        rig.close()


def test_passes_samples_on_and_reports(rigs: Callable[..., Rig], sender: socket.socket) -> None:
    rig = rigs(UdpLink())
    rig.wait(lambda: "silent" in rig.states())
    sender.sendto(b"1.5 2.5", ("127.0.0.1", rig.link.port))
    sender.sendto(b"nonsense", ("127.0.0.1", rig.link.port))
    rig.wait(lambda: any(report.malformed for report in rig.reports))
    assert rig.speeds == [1.5, 2.5]
    assert rig.states()[:2] == ["opening", "silent"]
    last = rig.reports[-1]
    assert (last.link, last.state, last.samples, last.malformed) == ("wheels", "up", 2, {"text": 1})
    assert rig.beats()[:2] == [None, "opening wheels"]


def test_retries_a_taken_port_and_says_why(rigs: Callable[..., Rig], sender: socket.socket) -> None:
    squatter = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    squatter.bind(("127.0.0.1", 0))
    port = squatter.getsockname()[1]
    rig = rigs(UdpLink(port))
    rig.wait(lambda: rig.states().count("retrying") >= 2)
    retrying = next(report for report in rig.reports if report.state == "retrying")
    assert f"port {port} is taken" in retrying.reason
    squatter.close()
    rig.wait(lambda: "silent" in rig.states())
    sender.sendto(b"3", ("127.0.0.1", port))
    rig.wait(lambda: rig.speeds == [3.0])


def test_opens_again_when_the_link_breaks_and_keeps_its_totals(
    rigs: Callable[..., Rig], sender: socket.socket
) -> None:
    rig = rigs(UdpLink())
    rig.wait(lambda: "silent" in rig.states())
    sender.sendto(b"1", ("127.0.0.1", rig.link.port))
    rig.wait(lambda: rig.speeds == [1.0])
    rig.link.broken = "the cable is out; plug it in"
    rig.wait(lambda: "retrying" in rig.states())
    rig.wait(lambda: rig.states()[-1] == "up")
    assert rig.link.opened == 2
    assert rig.reports[-1].samples == 1
    assert next(r.reason for r in rig.reports if r.state == "retrying") == "the cable is out; plug it in"


def test_a_full_queue_drops_and_counts_samples(rigs: Callable[..., Rig], sender: socket.socket) -> None:
    """Nobody reads: what was refused and what waits in the queue add up to what the link made."""
    rig = rigs(UdpLink(), room=4 * 1024)
    until = time.monotonic() + PATIENCE
    while not rig.link.port or rig.link.samples < 300:
        assert time.monotonic() < until
        if rig.link.port:
            sender.sendto(b"1 2 3", ("127.0.0.1", rig.link.port))
    taken = 0

    def all_accounted() -> bool:
        nonlocal taken
        taken = len(rig.speeds)
        last = rig.reports[-1] if rig.reports else None
        return last is not None and last.dropped > 0 and last.dropped + taken == last.samples

    rig.wait(all_accounted)
    assert taken > 0
