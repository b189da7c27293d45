"""The live link against an autopilot that speaks through a real UDP socket, with frames packed by hand."""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from drivers.link import Link, LinkError
from drivers.mavlink.link import MavlinkLink
from drivers.mavlink.port import UdpPort
from drivers.mavlink.settings import MavlinkSettings
from drivers.sample import Attitude, Presence, Sample
from tests.drivers.mavlink.wire import LAYOUTS, attitude, crc, frame, heartbeat, raw_frame

LONGEST = 5.0
BOOTED = 1_000  # seconds the autopilot claims to run for
Heard = tuple[int, int, int, tuple[float, ...]]
NAMES = {identifier: name for name, (identifier, _, _) in LAYOUTS.items()}


class Autopilot:
    """The other end: frames out, and what the link said, unpacked by hand."""

    def __init__(self, port: UdpPort) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect(port.address)
        self.socket.setblocking(False)
        self.heard: list[Heard] = []

    def say(self, *frames: bytes) -> None:
        for data in frames:
            self.socket.send(data)

    def listen(self) -> list[Heard]:
        """Return what came since: id, system, component, values in wire order."""
        fresh: list[Heard] = []
        while True:
            try:
                data = self.socket.recv(2_000)
            except BlockingIOError:
                self.heard += fresh
                return fresh
            fresh.append(self._unpacked(data))

    @staticmethod
    def _unpacked(data: bytes) -> Heard:
        assert data[0] == 0xFD
        body = data[10 : 10 + data[1]]
        identifier = int.from_bytes(data[7:10], "little")
        _, extra, layout = LAYOUTS[NAMES[identifier]]
        assert crc(data[1 : 10 + data[1]] + bytes((extra,))) == int.from_bytes(
            data[10 + data[1] :][:2], "little"
        )
        values = struct.unpack(layout, body.ljust(struct.calcsize(layout), b"\0"))
        return identifier, data[5], data[6], values


@pytest.fixture
def link() -> Iterator[MavlinkLink]:
    link = MavlinkLink("autopilot", MavlinkSettings(url="udpin:127.0.0.1:0", rates={"ATTITUDE": 50.0}))
    link.open()
    yield link
    link.close()


def autopilot_of(link: MavlinkLink) -> Autopilot:
    assert isinstance(link.port, UdpPort)
    return Autopilot(link.port)


@pytest.fixture
def autopilot(link: MavlinkLink) -> Iterator[Autopilot]:
    peer = autopilot_of(link)
    yield peer
    peer.socket.close()


def until(
    link: MavlinkLink, done: Callable[[], object], each: Callable[[], object] = lambda: None
) -> list[Sample]:
    """Poll until ``done``, for a bounded time; ``each`` is the peer's turn."""
    samples: list[Sample] = []
    end = time.monotonic() + LONGEST
    while not done():
        assert time.monotonic() < end, f"waited {LONGEST} s; {link.report()}"
        each()
        samples += link.poll(0.02)
    return samples


def named(heard: list[Heard], name: str) -> list[Heard]:
    return [message for message in heard if message[0] == LAYOUTS[name][0]]


def test_bytes_become_samples_on_the_monotonic_clock(link: MavlinkLink, autopilot: Autopilot) -> None:
    before = time.monotonic_ns()
    autopilot.say(heartbeat(), attitude(5_000, yaw=0.7))
    samples: list[Sample] = []
    while len(samples) < 2:
        samples += link.poll(1.0)
    presence, yaw = samples
    assert isinstance(presence.reading, Presence)
    assert isinstance(yaw.reading, Attitude)
    assert yaw.reading.yaw == pytest.approx(0.7)
    assert before <= yaw.time <= yaw.received <= time.monotonic_ns()
    report = link.report()
    assert (report.state, report.messages, report.samples, report.opened) == ("up", 2, 2, 1)


def test_it_says_that_it_is_there(link: MavlinkLink, autopilot: Autopilot) -> None:
    """HEARTBEAT as component 197 of the vehicle's system, an onboard controller without an autopilot."""
    until(
        link,
        lambda: any(m[1] == 9 for m in named(autopilot.heard, "HEARTBEAT")),
        lambda: (autopilot.say(heartbeat(system=9)), autopilot.listen()),
    )
    _, system, component, (_, kind, kind_of_autopilot, _, state, version) = named(
        autopilot.heard, "HEARTBEAT"
    )[-1]
    assert (system, component, kind, kind_of_autopilot, state, version) == (9, 197, 18, 8, 4, 3)


def test_it_asks_for_its_messages_and_again_after_a_reboot(link: MavlinkLink, autopilot: Autopilot) -> None:
    def questions() -> list[tuple[float, ...]]:
        return [values for _, _, _, values in named(autopilot.heard, "COMMAND_LONG")]

    def turn(boot_ms: int) -> None:
        autopilot.say(heartbeat(), attitude(boot_ms))
        for _ in named(autopilot.listen(), "COMMAND_LONG"):
            autopilot.say(frame("COMMAND_ACK", 511, 0, 0, 0, 1, 197))

    start = time.monotonic_ns()

    def uptime(since: int) -> int:
        return since * 1_000 + (time.monotonic_ns() - start) // 1_000_000

    until(link, lambda: len(questions()) == 1, lambda: turn(uptime(BOOTED)))
    message, interval, *rest = questions()[0]
    assert (message, interval) == (30.0, 20_000.0)
    assert rest == [0.0, 0.0, 0.0, 0.0, 0.0, 511, 1, 1, 0]
    until(link, lambda: len(questions()) == 2, lambda: turn(uptime(3)))
    assert questions()[1] == questions()[0]


def test_where_the_autopilot_refuses_it_asks_for_the_stream(link: MavlinkLink, autopilot: Autopilot) -> None:
    def turn() -> None:
        autopilot.say(heartbeat())
        for _ in named(autopilot.listen(), "COMMAND_LONG"):
            autopilot.say(frame("COMMAND_ACK", 400, 0, 0, 0, 0, 0))  # of another command
            autopilot.say(frame("COMMAND_ACK", 511, 0, 0, 0, 255, 190))  # to some one else
            autopilot.say(frame("COMMAND_ACK", 511, 4, 0, 0, 1, 197))

    until(link, lambda: named(autopilot.heard, "REQUEST_DATA_STREAM"), turn)
    *_, (rate, system, component, stream, start) = named(autopilot.heard, "REQUEST_DATA_STREAM")[0]
    assert (rate, system, component, stream, start) == (50, 1, 1, 10, 1)


def test_it_answers_timesync(link: MavlinkLink, autopilot: Autopilot) -> None:
    before = time.monotonic_ns()
    autopilot.say(heartbeat(), frame("TIMESYNC", 0, 123_456_789))
    answers: list[Heard] = []

    def turn() -> None:
        answers.extend(m for m in named(autopilot.listen(), "TIMESYNC") if m[3][0] != 0)

    until(link, lambda: answers, turn)
    *_, (ours, theirs) = answers[0]
    assert theirs == 123_456_789
    assert before <= ours <= time.monotonic_ns()


def test_its_timesync_finds_the_autopilots_clock(link: MavlinkLink, autopilot: Autopilot) -> None:
    """The autopilot's clock counts from BOOTED seconds at ``start``; others' answers are not believed."""
    start = time.monotonic_ns()

    def clock() -> int:
        return BOOTED * 10**9 + time.monotonic_ns() - start

    def turn() -> None:
        autopilot.say(heartbeat(), attitude(clock() // 1_000_000))
        for *_, (tc1, ts1) in named(autopilot.listen(), "TIMESYNC"):
            if tc1 == 0:
                autopilot.say(frame("TIMESYNC", 5 * 10**9, int(ts1), component=77))
                autopilot.say(frame("TIMESYNC", clock(), int(ts1)))

    until(link, lambda: link.report().clock == "timesync", turn)
    offset = link.report().offset
    assert offset is not None
    assert offset == pytest.approx(start / 1e9 - BOOTED, abs=0.05)  # a busy machine is late, not wrong


def test_a_malformed_flood_is_counted_and_costs_nothing_else(link: MavlinkLink, autopilot: Autopilot) -> None:
    good = [attitude(5_000 + i) for i in range(20)]
    bad = attitude(4_999)[:-1] + b"\x00"
    autopilot.say(heartbeat())
    until(link, lambda: link.report().messages == 1)
    for data in good:
        autopilot.say(b"\x00\x01garbage", bad, raw_frame(0xABCDEF, 1, b"?"), data)
    samples = until(link, lambda: link.report().messages == 21)
    assert len(samples) == 20
    report = link.report()
    assert report.malformed["unknown_message"] == 20
    assert report.malformed["bad_prefix"] == 20
    assert report.malformed["lost_bytes"] == 20 * (len(bad) + 9)


def test_what_the_vehicle_sent_and_did_not_arrive_is_counted(link: MavlinkLink, autopilot: Autopilot) -> None:
    """Only the vehicle's: a router passes on but some of what another says, and its gaps are no loss."""
    autopilot.say(heartbeat())  # number 0
    until(link, lambda: link.report().messages == 1)
    for number in (1, 2, 6, 7):
        autopilot.say(attitude(5_000 + 20 * number, sequence=number))
    autopilot.say(raw_frame(0xABCDEF, 1, b"?", sequence=8))  # a message of a newer dialect was not lost
    for number in (3, 60, 90):
        autopilot.say(attitude(5_000 + number, system=9, sequence=number))
    autopilot.say(frame("TIMESYNC", 0, 1, sequence=9), attitude(5_240, sequence=12))
    until(link, lambda: link.report().messages == 6)
    assert link.report().lost == 3 + 2


def test_what_passed_while_it_was_closed_is_not_known(link: MavlinkLink) -> None:
    first = autopilot_of(link)
    first.say(heartbeat(), attitude(5_000, sequence=1))
    until(link, lambda: link.report().messages == 2)
    link.close()
    link.open()
    second = autopilot_of(link)
    second.say(attitude(5_100, sequence=50), attitude(5_120, sequence=52))
    until(link, lambda: link.report().messages == 4)
    assert link.report().lost == 1
    for peer in (first, second):
        peer.socket.close()


def test_its_own_messages_sent_back_are_ignored(link: MavlinkLink, autopilot: Autopilot) -> None:
    autopilot.say(
        heartbeat(), heartbeat(component=197, kind=18, autopilot=8), frame("SIM_STATE", *[0.0] * 21, 1, 1)
    )
    until(link, lambda: link.report().ignored == 2)
    assert link.report().messages == 1


def test_noise_is_told_from_silence(
    link: MavlinkLink, autopilot: Autopilot, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A damaged frame of long ago does not mean that bytes arrive now."""
    autopilot.say(b"\xfd nonsense, a baud rate that is wrong")
    until(link, lambda: bool(link.report().malformed))
    assert "bytes arrive, but no message that is understood" in link.report().reason
    monkeypatch.setattr("drivers.mavlink.link.SILENT_AFTER", 1_000_000)
    until(link, lambda: "nothing arrives" in link.report().reason)
    assert link.report().malformed


def test_messages_without_a_signature_are_no_silence(tmp_path: Path) -> None:
    key = tmp_path / "key"
    key.write_bytes(bytes(32))
    link = MavlinkLink("autopilot", MavlinkSettings(url="udpin:127.0.0.1:0", signing_key_file=str(key)))
    link.open()
    autopilot = autopilot_of(link)
    autopilot.say(heartbeat())
    until(link, lambda: link.report().malformed == {"unsigned": 1})
    autopilot.socket.close()
    assert link.report().state == "silent"
    assert "bytes arrive, but no message that is signed with the key" in link.report().reason
    link.close()


def test_silence_is_said() -> None:
    link: Link = MavlinkLink("autopilot", MavlinkSettings(url="udpin:127.0.0.1:0"))
    assert link.report().state == "opening"
    link.open()
    assert link.poll(0.0) == []
    assert link.report().state == "silent"
    assert "nothing arrives" in link.report().reason
    link.close()
    link.close()


def test_noise_is_said_to_be_noise(link: MavlinkLink, autopilot: Autopilot) -> None:
    autopilot.say(b"GET / HTTP/1.1\r\n\r\n")
    until(link, lambda: link.report().malformed)
    assert link.report().state == "silent"
    assert "no message that is understood" in link.report().reason


def test_with_a_key_the_unsigned_is_refused(tmp_path: Path) -> None:
    key = tmp_path / "key"
    key.write_bytes(bytes(32))
    link = MavlinkLink("autopilot", MavlinkSettings(url="udpin:127.0.0.1:0", signing_key_file=str(key)))
    link.open()
    autopilot = autopilot_of(link)
    autopilot.say(heartbeat(), attitude(5_000))
    until(link, lambda: link.report().malformed == {"unsigned": 2})
    assert link.report().messages == 0
    autopilot.socket.close()
    link.close()


def test_polling_what_is_not_open_says_so() -> None:
    link = MavlinkLink("autopilot", MavlinkSettings(url="udpin:127.0.0.1:0"))
    with pytest.raises(LinkError, match="autopilot: is not open"):
        link.poll(0.0)


def test_it_opens_again_after_it_was_closed(link: MavlinkLink) -> None:
    first = autopilot_of(link)
    first.say(heartbeat())
    until(link, lambda: link.report().messages == 1)
    link.close()
    link.open()
    second = autopilot_of(link)
    second.say(heartbeat())
    until(link, lambda: link.report().messages == 2)
    assert link.report().opened == 2
    for peer in (first, second):
        peer.socket.close()


def test_a_taken_port_is_a_link_error(link: MavlinkLink) -> None:
    assert isinstance(link.port, UdpPort)
    other = MavlinkLink("other", MavlinkSettings(url=f"udpin:127.0.0.1:{link.port.address[1]}"))
    with pytest.raises(LinkError, match="another program has that port"):
        other.open()
