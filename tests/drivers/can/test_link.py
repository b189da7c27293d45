"""The live link on python-can's own buses: one in the process, and a serial adapter on a pseudo-terminal."""

from __future__ import annotations

import os
import select
import socket
import time
import tty
import uuid
from collections.abc import Callable, Iterator
from types import SimpleNamespace

import can
import msgspec
import pytest
from can.interfaces import slcan

from drivers.can import CanFrame, CanLink, CanSettings
from drivers.link import Link, LinkError
from drivers.sample import GeodeticPosition, MotorSpeed, Pressure, Sample, Velocity
from tests.drivers.can.encoding import fix, frames, message


def collect(link: CanLink, count: int, seconds: float = 10.0) -> list[Sample]:
    samples: list[Sample] = []
    until = time.monotonic() + seconds
    while len(samples) < count and time.monotonic() < until:
        samples += link.poll(0.1)
    return samples


def wait(condition: Callable[[], bool], seconds: float = 10.0) -> None:
    until = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < until, f"not within {seconds} s"
        time.sleep(0.005)


def as_message(frame: CanFrame) -> can.Message:
    return can.Message(
        arbitration_id=frame.identifier, data=frame.data, is_extended_id=frame.extended, is_fd=frame.flexible
    )


@pytest.fixture
def channel() -> str:
    """A name that no other test's bus has."""
    return uuid.uuid4().hex


@pytest.fixture
def node(channel: str) -> Iterator[can.BusABC]:
    with can.Bus(channel=channel, interface="virtual") as bus:
        yield bus


@pytest.fixture
def link(channel: str, node: can.BusABC) -> Iterator[CanLink]:
    opened = CanLink("bus", CanSettings(interface="virtual", channel=channel))
    opened.open()
    yield opened
    opened.close()


def send(node: can.BusABC, some: list[CanFrame]) -> None:
    for frame in some:
        node.send(as_message(frame))


def test_frames_of_a_bus_become_samples(link: CanLink, node: can.BusABC) -> None:
    as_link: Link = link
    before = time.monotonic_ns()
    send(node, frames(fix()) + frames(message("esc.Status", rpm=60)))
    samples = collect(link, 3)
    assert [type(s.reading) for s in samples] == [GeodeticPosition, Velocity, MotorSpeed]
    assert all(before - 1_000_000 <= s.time <= s.received <= time.monotonic_ns() for s in samples)
    assert {s.link for s in samples} == {"bus"}
    report = as_link.report()
    assert (report.state, report.messages, report.samples, report.opened) == ("up", 2, 3, 1)


def test_a_frame_that_waited_is_dated_by_its_arrival(link: CanLink, node: can.BusABC) -> None:
    assert link.poll(0.0) == []
    send(node, frames(message("air_data.StaticPressure", static_pressure=9e4)))
    sent = time.monotonic_ns()
    wait(lambda: time.monotonic_ns() - sent > 200_000_000)
    (sample,) = link.poll(0.0)
    assert abs(sample.time - sent) < 100_000_000


def test_one_poll_is_bounded(link: CanLink, node: can.BusABC) -> None:
    pressure = message("air_data.StaticPressure", static_pressure=9e4)
    send(node, [frames(pressure, number=n % 32)[0] for n in range(2000)])
    first = link.poll(1.0)
    assert 0 < len(first) < 2000
    assert len(first) + len(collect(link, 2000 - len(first))) == 2000


def test_remote_standard_error_and_damaged_frames(link: CanLink, node: can.BusABC) -> None:
    node.send(can.Message(arbitration_id=0x1004042A, is_remote_frame=True, dlc=8))
    node.send(can.Message(arbitration_id=0x123, data=b"12345678", is_extended_id=False))
    node.send(can.Message(arbitration_id=0x04, data=bytes(8), is_error_frame=True))
    send(node, frames(fix())[4:] + frames(message("air_data.StaticPressure", static_pressure=9e4)))
    (sample,) = collect(link, 1)
    assert isinstance(sample.reading, Pressure)
    report = link.report()
    assert report.malformed == {"error_frame": 1, "missing_start": 1}
    assert report.ignored == 2


def test_a_controller_off_the_bus_breaks_the_link_after_what_came_before(
    link: CanLink, node: can.BusABC
) -> None:
    send(node, frames(message("air_data.StaticPressure", static_pressure=9e4)))
    node.send(can.Message(arbitration_id=0x40, data=bytes(8), is_error_frame=True))
    assert len(link.poll(1.0)) == 1
    with pytest.raises(LinkError, match=r"bus: virtual .* off the bus .* check wiring"):
        link.poll(1.0)
    link.open()
    send(node, frames(message("air_data.StaticPressure", static_pressure=9e4), number=1))
    assert len(collect(link, 1)) == 1


def test_silence_is_said(link: CanLink) -> None:
    assert link.report().state == "up"
    wait(lambda: link.report().state == "silent")
    assert "nothing heard on virtual" in link.report().reason


def test_closed_twice_and_polled(link: CanLink) -> None:
    link.close()
    link.close()
    assert link.report().state == "opening"
    with pytest.raises(LinkError, match="open it first"):
        link.poll(0.0)


def test_the_stamps_of_a_node_show_in_the_report(link: CanLink, node: can.BusABC) -> None:
    assert link.report().clock == "arrival"
    payload = message("range_sensor.Measurement", range=1.0, reading_type=1)
    payload.timestamp.usec = 5_000_000
    send(node, frames(payload))
    assert len(collect(link, 1)) == 1
    report = link.report()
    assert report.clock == "envelope"
    assert report.offset is not None


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        (
            CanSettings(interface="nonsense"),
            r"cannot open nonsense can0: .*interface should be one of .*mcast",
        ),
        (CanSettings(interface="slcan", channel="/dev/absent"), r"/dev/absent: .*no such device; plug it in"),
        (CanSettings(interface="mcast", channel="first"), "channel: mcast needs the number of the bus"),
        (CanSettings(interface="slcan", channel=""), "Must specify a serial port.; check interface, channel"),
    ],
    ids=["interface", "device", "number", "empty"],
)
def test_what_cannot_be_opened_is_said_with_what_would_be_right(settings: CanSettings, text: str) -> None:
    with pytest.raises(LinkError, match=text):
        CanLink("bus", settings).open()


class Refused(can.BusABC):
    """A bus whose socket the kernel has bound, and against which it has something to say."""

    def __init__(self, channel: str, **_settings: object) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as nobody:
            nobody.bind(("127.0.0.1", 0))
            self._socket.connect(nobody.getsockname())
        self._socket.send(b"x")
        assert select.select([self._socket], [], [], 5.0)[0], "the kernel's answer"
        super().__init__(channel)

    def fileno(self) -> int:
        return self._socket.fileno()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        raise NotImplementedError

    def shutdown(self) -> None:
        super().shutdown()
        self._socket.close()


def test_an_interface_that_the_kernel_binds_but_that_is_down(monkeypatch: pytest.MonkeyPatch) -> None:
    """As with ENETDOWN on vcan0 (see socketcan_session): the error waits in the socket, the bus is closed."""
    monkeypatch.setitem(can.interfaces.BACKENDS, "socketcan", (__name__, "Refused"))
    link = CanLink("bus", CanSettings(channel="vcan0"))
    with pytest.raises(LinkError, match=r"bus: cannot open socketcan vcan0: .*Connection refused"):
        link.open()
    assert link.report().state == "opening"


def test_what_is_raised_is_not_logged_at_every_attempt_besides(caplog: pytest.LogCaptureFixture) -> None:
    link = CanLink("bus", CanSettings(interface="udp_multicast", channel="999.0.0.1"))
    for _ in range(2):
        with pytest.raises(LinkError):
            link.open()
    assert not caplog.records


def test_an_absent_socketcan_interface() -> None:
    with pytest.raises(
        LinkError, match=r"cannot open socketcan absent9: .*(no such interface|this kernel has no)"
    ):
        CanLink("bus", CanSettings(channel="absent9")).open()


class Adapter:
    """A serial CAN adapter (slcan) at the other end of a pseudo-terminal."""

    def __init__(self) -> None:
        self.ours, self._theirs = os.openpty()
        tty.setraw(self.ours)
        tty.setraw(self._theirs)
        self.device = os.ttyname(self._theirs)
        self.heard = b""
        self.plugged = True

    def listen(self) -> None:
        while select.select([self.ours], [], [], 0.0)[0]:
            self.heard += os.read(self.ours, 4096)

    def say(self, some: list[CanFrame]) -> None:
        for f in some:
            os.write(self.ours, b"T%08X%d%s\r" % (f.identifier, len(f.data), f.data.hex().upper().encode()))

    def unplug(self) -> None:
        self.plugged = False
        for end in (self.ours, self._theirs):
            os.close(end)

    def settings(self) -> CanSettings:
        return CanSettings(interface="slcan", channel=self.device, bitrate=1_000_000)


@pytest.fixture
def adapter() -> Iterator[Adapter]:
    made = Adapter()
    yield made
    if made.plugged:
        made.unplug()


def test_a_serial_adapter(adapter: Adapter) -> None:
    link = CanLink("bus", adapter.settings())
    link.open()
    try:
        adapter.listen()
        assert b"S8\r" in adapter.heard  # a megabit
        assert b"O\r" in adapter.heard
        adapter.say(frames(fix()))
        assert [type(s.reading) for s in collect(link, 2)] == [GeodeticPosition, Velocity]
    finally:
        link.close()
    adapter.listen()
    assert adapter.heard.endswith(b"C\r")


@pytest.mark.parametrize(
    ("options", "slept"), [({}, [0.0]), ({"sleep_after_open": 0.25}, [0.25])], ids=["default", "configured"]
)
def test_a_serial_adapter_is_waited_for_only_where_the_options_say_so(
    adapter: Adapter, monkeypatch: pytest.MonkeyPatch, options: dict[str, float], slept: list[float]
) -> None:
    sleeps: list[float] = []
    monkeypatch.setattr(slcan, "time", SimpleNamespace(**{**vars(time), "sleep": sleeps.append}))
    link = CanLink("bus", msgspec.structs.replace(adapter.settings(), options=options))
    link.open()
    link.close()
    assert sleeps == slept


def test_noise_on_the_serial_line_is_counted(adapter: Adapter) -> None:
    link = CanLink("bus", adapter.settings())
    link.open()
    try:
        for count, noise in enumerate((b"Txxxxxxxx8\r", b"T12\r", b"T1004042A3zzzzzz\r", b"\xff\xfe\r"), 1):
            os.write(adapter.ours, noise)
            wait(
                lambda count=count: (
                    not link.poll(0.01) and link.report().malformed.get("damaged_frame") == count
                )
            )
        os.write(adapter.ours, b"hello\r\r\a")
        adapter.say(frames(message("air_data.StaticPressure", static_pressure=9e4)))
        (sample,) = collect(link, 1)
        assert isinstance(sample.reading, Pressure)
        assert link.report().malformed == {"damaged_frame": 4}
    finally:
        link.close()


def test_nothing_but_noise_breaks_the_link(adapter: Adapter) -> None:
    link = CanLink("bus", adapter.settings())
    link.open()

    def poll_noise() -> None:
        until = time.monotonic() + 10.0
        while time.monotonic() < until:
            os.write(adapter.ours, b"Txxxxxxxx8\r" * 100)
            link.poll(0.01)

    with pytest.raises(LinkError, match=r"brings only damaged frames: .*; check bitrate and interface"):
        poll_noise()
    link.close()


def test_an_adapter_unplugged_and_plugged_in_again(adapter: Adapter) -> None:
    link = CanLink("bus", adapter.settings())
    link.open()
    adapter.say(frames(message("air_data.StaticPressure", static_pressure=9e4)))
    assert len(collect(link, 1)) == 1
    adapter.unplug()

    def poll_until_it_breaks() -> None:
        for _ in range(100):
            link.poll(0.1)

    with pytest.raises(LinkError, match=f"bus: slcan {adapter.device} broke: .*"):
        poll_until_it_breaks()
    link.close()
    again = Adapter()
    link = CanLink("bus", again.settings())
    link.open()
    again.say(frames(message("air_data.StaticPressure", static_pressure=9e4)))
    assert len(collect(link, 1)) == 1
    link.close()
    again.unplug()
