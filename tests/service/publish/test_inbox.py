"""The inbox takes anything, forwards what is well formed, and lets the newest win."""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.publish.inbox import Inbox, MalformedError, Value, parse
from service.publish.topics import CLOUD_BYTES


@pytest.fixture
def pair() -> Iterator[tuple[socket.socket, Inbox]]:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    with ours, theirs:
        yield ours, Inbox(theirs)


def test_an_empty_socket_gives_nothing_at_once(pair: tuple[socket.socket, Inbox]) -> None:
    _, inbox = pair
    assert inbox.drain() == []


def test_the_newest_state_wins_and_the_rest_is_counted(pair: tuple[socket.socket, Inbox]) -> None:
    loop, inbox = pair
    for datagram in (b"E1", b"B1", b"E2", b"S1", b"E3", b"S2", b"R1"):
        loop.send(datagram)
    assert inbox.drain() == [
        Value("budget", b"1"),
        Value("estimate", b"3"),
        Value("sensors", b"2"),
        Value("processes", b"1"),
    ]
    assert inbox.superseded == {"estimate": 2, "sensors": 1}
    assert inbox.drain() == []


def test_every_change_of_health_goes_out_in_order(pair: tuple[socket.socket, Inbox]) -> None:
    loop, inbox = pair
    for datagram in (b"Hwaiting", b"E1", b"Hconverging", b"E2", b"Htracking"):
        loop.send(datagram)
    assert inbox.drain() == [
        Value("health", b"waiting"),
        Value("health", b"converging"),
        Value("health", b"tracking"),
        Value("estimate", b"2"),
    ]
    assert inbox.superseded == {"estimate": 1}


def test_a_cloud_is_taken_apart_into_rows_and_description() -> None:
    rows = struct.pack("<8f", 1, 2, 3, 0.25, 5, 6, 7, 0.75)
    assert parse(b"P\x02\x00\x00\x00{}" + rows) == Value("particles", rows, b"{}")


def test_the_largest_cloud_passes_and_one_row_more_is_refused() -> None:
    assert len(parse(b"P\x02\x00\x00\x00{}" + bytes(CLOUD_BYTES)).payload) == CLOUD_BYTES == 3072 * 16
    with pytest.raises(MalformedError, match="large_cloud"):
        parse(b"P\x02\x00\x00\x00{}" + bytes(CLOUD_BYTES + 16))


@pytest.mark.parametrize(
    ("datagram", "kind"),
    [
        (b"", "unknown_tag"),
        (b"Z{}", "unknown_tag"),
        (b"E", "empty"),
        (b"P", "empty"),
        (b"P\x02\x00", "broken_cloud"),
        (b"P\x00\x00\x00\x00" + bytes(16), "broken_cloud"),
        (b"P\xff\xff\xff\xff{}" + bytes(16), "broken_cloud"),
        (b"P\x02\x00\x00\x00{}" + bytes(17), "broken_cloud"),
        (b"E" + bytes(256 * 1024), "too_long"),
    ],
)
def test_what_is_no_datagram_is_refused_by_kind(datagram: bytes, kind: str) -> None:
    with pytest.raises(MalformedError) as refusal:
        parse(datagram)
    assert refusal.value.kind == kind


def test_what_is_refused_is_counted_and_costs_nothing_else(pair: tuple[socket.socket, Inbox]) -> None:
    loop, inbox = pair
    for datagram in (b"Z", b"E1", b"P\x01", b"", b"Z2"):
        loop.send(datagram)
    assert inbox.drain() == [Value("estimate", b"1")]
    assert inbox.malformed == {"unknown_tag": 3, "broken_cloud": 1}


def test_a_flood_does_not_keep_the_caller() -> None:
    loop, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    with loop, theirs:
        inbox = Inbox(theirs, at_once=8)
        for sequence in range(20):
            loop.send(b"E%d" % sequence)
        newest = [value.payload for _ in range(4) for value in inbox.drain()]
    assert newest == [b"7", b"15", b"19"]
    assert inbox.superseded["estimate"] == 17


@given(st.binary(max_size=400))
def test_any_bytes_are_a_value_or_refused(datagram: bytes) -> None:
    try:
        value = parse(datagram)
    except MalformedError:
        return
    if value.attachment is None:
        assert value.payload == datagram[1:]
    else:
        assert datagram[5:] == value.attachment + value.payload
        assert len(value.payload) % 16 == 0


@given(st.lists(st.sampled_from([b"E", b"B", b"S", b"H", b"P", b"R", b"?"]), max_size=60))
def test_nothing_is_lost_without_a_count(tags: list[bytes]) -> None:
    bodies = {b"P": b"\x01\x00\x00\x00x" + bytes(16)}
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    with ours, theirs:
        inbox = Inbox(theirs)
        for tag in tags:
            ours.send(tag + bodies.get(tag, b"1"))
        out = inbox.drain()
    assert len(out) + inbox.superseded.total() + inbox.malformed.total() == len(tags)
    states = [value.topic for value in out if value.topic != "health"]
    assert len(states) == len(set(states))
