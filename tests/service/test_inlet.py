"""The loop's end of a link: everything is taken, or left, or counted."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator

import pytest

from drivers.sample import LinkReport, Sample, SampleBatch, Speed, encode
from service.channels import Pair, pair
from service.inlet import MOST_DATAGRAMS, Inlet

FOREVER = 2**62


@pytest.fixture
def queue() -> Iterator[Pair]:
    ends = pair(1024 * 1024)
    yield ends
    ends.close()


def batch(*times: int) -> bytes:
    return encode(SampleBatch([Sample(t, t + 5, "bus", "test", Speed(1.0)) for t in times]))


def test_hands_on_samples_in_order(queue: Pair) -> None:
    inlet, taken = Inlet("bus", queue.inlet), list[Sample]()
    queue.outlet.send(batch(1, 2))
    queue.outlet.send(batch(3))
    inlet.drain(taken.extend, FOREVER)
    assert [sample.time for sample in taken] == [1, 2, 3]
    assert (inlet.waiting, inlet.samples, inlet.deferred) == (2, 3, 0)
    inlet.drain(taken.extend, FOREVER)
    assert inlet.waiting == 0


def test_keeps_the_last_report(queue: Pair) -> None:
    inlet = Inlet("bus", queue.inlet)
    assert inlet.status(0).state == "starting"
    assert inlet.status(0).age is None
    queue.outlet.send(
        encode(
            LinkReport(
                "bus", "retrying", "port taken", malformed={"crc": 3}, unusable={"fix": 9}, dropped=7, lost=4
            )
        )
    )
    queue.outlet.send(batch(1_000_000_000))
    inlet.drain(lambda _: None, FOREVER)
    status = inlet.status(3_000_000_005)
    assert (status.state, status.reason, status.malformed) == ("retrying", "port taken", {"crc": 3})
    assert (status.unusable, status.lost) == ({"fix": 9}, 4)
    assert inlet.dropped == status.dropped == 7
    assert status.age == pytest.approx(2.0)


@pytest.mark.parametrize("wreck", [b"\xc1", b"", b"not one", batch(1)[:-1], b"\x93" * 1000])
def test_what_is_no_datagram_is_counted(queue: Pair, wreck: bytes) -> None:
    inlet, taken = Inlet("bus", queue.inlet), list[Sample]()
    queue.outlet.send(wreck)
    queue.outlet.send(batch(1))
    inlet.drain(taken.extend, FOREVER)
    assert inlet.undecodable == 1
    assert len(taken) == 1


def test_a_tick_that_has_no_time_left_takes_one_and_leaves_the_rest(queue: Pair) -> None:
    inlet, taken = Inlet("bus", queue.inlet), list[Sample]()
    for t in range(5):
        queue.outlet.send(batch(t))
    inlet.drain(taken.extend, time.monotonic_ns())
    assert len(taken) == 1
    assert (inlet.waiting, inlet.deferred) == (2, 1)
    inlet.drain(taken.extend, FOREVER)
    assert [sample.time for sample in taken] == [0, 1, 2, 3, 4]


def test_the_number_per_tick_is_bounded_and_nothing_is_lost(queue: Pair) -> None:
    inlet, taken = Inlet("bus", queue.inlet), list[Sample]()
    sent = 0
    with contextlib.suppress(BlockingIOError):
        while queue.outlet.send(batch(sent)):
            sent += 1
    assert sent > MOST_DATAGRAMS, "the queue must hold more than one tick takes for this test to say anything"
    inlet.drain(taken.extend, FOREVER)
    assert len(taken) == MOST_DATAGRAMS
    assert inlet.deferred == 1
    while inlet.waiting:
        inlet.drain(taken.extend, FOREVER)
    assert [sample.time for sample in taken] == list(range(sent))


def test_exactly_the_bound_is_not_called_deferred(queue: Pair) -> None:
    inlet = Inlet("bus", queue.inlet)
    queue.outlet.send(batch(1))
    inlet.drain(lambda _: None, 0)
    assert (inlet.waiting, inlet.deferred) == (1, 0)
