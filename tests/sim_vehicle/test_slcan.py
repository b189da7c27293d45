"""The serial adapter, with python-can's own slcan interface at the other end."""

from __future__ import annotations

import os
import select
from collections.abc import Iterator
from pathlib import Path

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_vehicle.frame import CanFrame
from sim_vehicle.slcan import Adapter, frame_line, parsed

FRAME = CanFrame(0x1004172A, bytes(range(8)))


@pytest.fixture
def adapter(tmp_path: Path) -> Iterator[Adapter]:
    made = Adapter(str(tmp_path / "bus" / "can0"))
    yield made
    made.close()


def opened(adapter: Adapter) -> can.BusABC:
    """Open the adapter as a client does, and let it take in the client's commands."""
    bus = can.Bus(
        interface="slcan", channel=adapter.address.partition(":")[2], bitrate=1_000_000, sleep_after_open=0.0
    )
    while select.select(adapter.filenos(), [], [], 0.05)[0]:
        adapter.serve()
    assert adapter.open
    return bus


def received(bus: can.BusABC, count: int) -> list[can.Message]:
    """Return the next messages; each is waited for at most 5 s."""
    messages: list[can.Message] = []
    while len(messages) < count:
        message = bus.recv(timeout=5.0)
        assert message is not None, f"{len(messages)} of {count} frames came"
        messages.append(message)
    return messages


def test_a_client_reads_the_frames(adapter: Adapter) -> None:
    with opened(adapter) as bus:
        adapter.send(FRAME)
        adapter.send(CanFrame(0x123, b"\x01", extended=False))
        extended, standard = received(bus, 2)
    assert (extended.arbitration_id, extended.is_extended_id, bytes(extended.data)) == (
        0x1004172A,
        True,
        FRAME.data,
    )
    assert (standard.arbitration_id, standard.is_extended_id, bytes(standard.data)) == (0x123, False, b"\x01")


def test_a_client_may_go_and_come_back_and_sees_nothing_stale(adapter: Adapter) -> None:
    first = opened(adapter)
    adapter.send(FRAME)
    first.shutdown()
    adapter.serve()
    assert not adapter.open
    adapter.send(FRAME)
    assert adapter.dropped == 1
    with opened(adapter) as second:
        fresh = CanFrame(0x77, b"fresh")
        adapter.send(fresh)
        (message,) = received(second, 1)
    assert bytes(message.data) == b"fresh"


def test_a_client_that_vanishes_blocks_nothing(adapter: Adapter) -> None:
    descriptor = os.open(adapter.address.partition(":")[2], os.O_RDWR | os.O_NOCTTY)
    os.write(descriptor, b"O\r")
    select.select(adapter.filenos(), [], [], 5.0)
    adapter.serve()
    os.close(descriptor)
    for _ in range(5000):
        adapter.send(FRAME)
    assert adapter.sent + adapter.dropped == 5000
    assert adapter.dropped > 0
    with opened(adapter) as bus:
        adapter.send(CanFrame(0x77, b"fresh"))
        assert bytes(received(bus, 1)[0].data) == b"fresh"


def test_a_slow_client_loses_whole_frames_and_never_a_part_of_one(adapter: Adapter) -> None:
    with opened(adapter) as bus:
        for count in range(5000):
            adapter.send(CanFrame(count, count.to_bytes(8, "big")))
        there = adapter.sent
        assert 0 < there < 5000
        seen = received(bus, there - 1)
        # The last of them may have been cut by the full buffer: its rest comes before the next frame.
        adapter.send(CanFrame(9999, (9999).to_bytes(8, "big")))
        seen += received(bus, 2)
    assert [message.arbitration_id for message in seen] == [*range(there), 9999]
    assert all(int.from_bytes(message.data, "big") == message.arbitration_id for message in seen)


def test_the_clients_frames_come_in_and_its_questions_are_answered(adapter: Adapter) -> None:
    with opened(adapter) as bus:
        bus.send(can.Message(arbitration_id=0x18FF, data=b"\x01\x02", is_extended_id=True))
        select.select(adapter.filenos(), [], [], 5.0)
        adapter.serve()
        assert (adapter.received, adapter.malformed) == (1, 0)
        bus._write("V")
        bus._write("N")
        bus._write("T123")
        while adapter.malformed == 0 and select.select(adapter.filenos(), [], [], 5.0)[0]:
            adapter.serve()
        assert adapter.malformed == 1
        assert bus.get_version(timeout=5.0) == (10, 13)


def test_the_path_must_be_free_and_goes_away_with_the_adapter(tmp_path: Path) -> None:
    taken = tmp_path / "file"
    taken.write_text("mine")
    with pytest.raises(FileExistsError, match="is no symbolic link"):
        Adapter(str(taken))
    path = tmp_path / "can0"
    old = Adapter(str(path))
    new = Adapter(str(path))
    old.close()
    assert path.is_symlink(), "the newer adapter's link stays"
    new.close()
    assert not path.is_symlink()


frames = st.builds(
    CanFrame, st.integers(0, (1 << 29) - 1), st.binary(max_size=8), st.just(value=True)
) | st.builds(CanFrame, st.integers(0, (1 << 11) - 1), st.binary(max_size=8), st.just(value=False))


@given(frames)
def test_a_line_says_the_frame(frame: CanFrame) -> None:
    assert parsed(frame_line(frame).rstrip(b"\r")) == frame


@given(st.binary(max_size=40))
def test_no_line_is_too_strange(line: bytes) -> None:
    frame = parsed(line)
    assert frame is None or frame_line(frame).lower().rstrip(b"\r")[:2] == line[:2].lower()
