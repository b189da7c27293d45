"""Queues between processes, on real socket pairs."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator

import numpy as np
import pytest

from service.channels import Heart, Outlet, Pair, cloud, pair, undertaking
from service.publish.inbox import TAGS, parse


@pytest.fixture
def queue() -> Iterator[Pair]:
    ends = pair(64 * 1024)
    yield ends
    ends.close()


def test_datagrams_come_out_whole_and_in_order(queue: Pair) -> None:
    outlet = Outlet(queue.outlet)
    sent = [bytes([i]) * (i * 100 + 1) for i in range(20)]
    assert all(outlet.send(datagram) for datagram in sent)
    assert [queue.inlet.recv(65536) for _ in sent] == sent
    assert outlet.dropped == 0


def test_a_full_queue_refuses_and_counts(queue: Pair) -> None:
    """What was sent and what was refused add up to what there was."""
    outlet = Outlet(queue.outlet)
    accepted = sum(outlet.send(bytes(1000)) for _ in range(1000))
    received = 0
    with contextlib.suppress(BlockingIOError):
        while queue.inlet.recv(2000):
            received += 1
    assert 0 < accepted < 1000
    assert received == accepted
    assert outlet.dropped == 1000 - accepted
    assert outlet.send(b"room again")


def test_a_reader_that_has_gone_costs_nothing(queue: Pair) -> None:
    outlet = Outlet(queue.outlet)
    queue.inlet.close()
    assert not outlet.send(b"x")
    assert outlet.dropped == 1


def test_a_datagram_larger_than_the_queue_is_refused_and_counted(queue: Pair) -> None:
    outlet = Outlet(queue.outlet)
    assert not outlet.send(bytes(16 * 1024 * 1024))
    assert outlet.dropped == 1
    assert outlet.send(b"the next one")


def test_two_megabytes_are_granted_or_the_system_limit() -> None:
    ends = pair(2 * 1024 * 1024)
    outlet = Outlet(ends.outlet)
    held = sum(outlet.send(bytes(1000)) for _ in range(4000))
    ends.close()
    assert held >= 100


def test_heart_beats_and_announces(queue: Pair) -> None:
    heart = Heart(queue.outlet)
    heart.beat()
    heart.announce("compiling kernels, 3 of 12: motion")
    heart.beat()
    heard = [queue.inlet.recv(256) for _ in range(3)]
    assert [undertaking(datagram) for datagram in heard] == [
        None,
        "compiling kernels, 3 of 12: motion",
        None,
    ]
    assert int.from_bytes(heard[2], "little") == 2


def test_an_announcement_of_eight_letters_is_no_beat(queue: Pair) -> None:
    Heart(queue.outlet).announce("12345678")
    Heart(queue.outlet).announce("")
    assert undertaking(queue.inlet.recv(256)) == "12345678"
    assert undertaking(queue.inlet.recv(256)) == ""


def test_heart_hears_the_supervisor_once(queue: Pair) -> None:
    heart = Heart(queue.outlet)
    assert not heart.called()
    queue.inlet.send(b"!")
    assert heart.called()
    assert not heart.called()


def test_cloud_is_what_the_publisher_takes_apart() -> None:
    rows = np.arange(12, dtype="<f4").reshape(3, 4)
    value = parse(cloud(json.dumps({"count": 3}).encode(), rows.tobytes()))
    assert value.attachment == b'{"count": 3}'
    np.testing.assert_array_equal(np.frombuffer(value.payload, "<f4").reshape(-1, 4), rows)


def test_tags_are_those_the_publisher_knows() -> None:
    from service import channels

    tags = {
        channels.ESTIMATE,
        channels.BUDGET,
        channels.SENSORS,
        channels.HEALTH,
        channels.CLOUD,
        channels.HYPOTHESES,
        channels.PROCESSES,
    }
    assert tags == set(TAGS)
