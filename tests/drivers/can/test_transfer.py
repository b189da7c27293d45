"""Reassembly against hand-built frames: the order of tail bytes, the checksum, and everything that can be
lost."""

from __future__ import annotations

import itertools
from random import Random

from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.can import CanFrame
from drivers.can.dsdl import DataType
from drivers.can.readings import DATA_TYPES
from drivers.can.transfer import TIME_OUT_NS, Reassembler, Transfer, message_identifier
from tests.drivers.can.encoding import fix, frames, message

SECOND = 1_000_000_000


def accepted(reassembler: Reassembler, some: list[CanFrame], at: int = 0) -> list[Transfer]:
    results = [reassembler.accept(frame, at + i) for i, frame in enumerate(some)]
    return [transfer for transfer in results if transfer is not None]


def test_a_single_frame_by_hand() -> None:
    """StaticPressure 101325 Pa, variance 1: priority 16, type 1028, source 42, transfer 7."""
    data = bytes.fromhex("80e6c547") + bytes.fromhex("003c") + bytes([0xC0 | 7])
    reassembler = Reassembler(DATA_TYPES)
    transfer = reassembler.accept(CanFrame(0x1004042A, data), 5)
    assert transfer is not None
    assert (transfer.data_type.name, transfer.source, transfer.received_ns) == (
        "air_data.StaticPressure",
        42,
        5,
    )
    assert transfer.data_type.unpack(transfer.payload) == {
        "static_pressure": 101325.0,
        "static_pressure_variance": 1.0,
    }


def test_a_transfer_of_several_frames_by_hand() -> None:
    """esc.Status, 14 bytes of zeros from node 1: the checksum worked out bit by bit, the toggle from frame to
    frame."""
    signature = 0xA9AF28AEA2FBB254  # of uavcan.equipment.esc.Status, from the specification's list of types
    checksum = bitwise_checksum(bytes(14), bitwise_checksum(signature.to_bytes(8, "little"), 0xFFFF))
    payload = checksum.to_bytes(2, "little") + bytes(14)
    sent = [
        CanFrame(1034 << 8 | 1, payload[0:7] + bytes([0x80 | 3])),
        CanFrame(1034 << 8 | 1, payload[7:14] + bytes([0x20 | 3])),
        CanFrame(1034 << 8 | 1, payload[14:] + bytes([0x40 | 3])),
    ]
    reassembler = Reassembler(DATA_TYPES)
    (transfer,) = accepted(reassembler, sent, at=100)
    assert transfer.payload == bytes(14)
    assert transfer.received_ns == 100  # the first frame's
    assert not reassembler.malformed


def bitwise_checksum(data: bytes, register: int) -> int:
    for byte in data:
        register ^= byte << 8
        for _ in range(8):
            register = (register << 1 ^ (0x1021 if register & 0x8000 else 0)) & 0xFFFF
    return register


def test_sources_and_types_may_interleave() -> None:
    a, b = frames(fix(), source=1), frames(fix(status=2), source=2)
    c = frames(message("esc.Status", rpm=5), source=1)
    mixed = [f for trio in itertools.zip_longest(a, b, c) for f in trio if f is not None]
    reassembler = Reassembler(DATA_TYPES)
    found = {(t.data_type.name, t.source) for t in accepted(reassembler, mixed)}
    assert found == {("gnss.Fix2", 1), ("gnss.Fix2", 2), ("esc.Status", 1)}
    assert not reassembler.malformed


def test_joining_in_the_middle_is_counted_once_and_the_next_transfer_is_whole() -> None:
    reassembler = Reassembler(DATA_TYPES)
    assert accepted(reassembler, frames(fix(), number=1)[3:] + frames(fix(), number=2))
    assert reassembler.malformed == {"missing_start": 1}


def test_a_lost_frame_in_the_middle() -> None:
    sent = frames(fix(), number=4)
    del sent[5]
    reassembler = Reassembler(DATA_TYPES)
    assert len(accepted(reassembler, sent + frames(fix(), number=5))) == 1
    assert reassembler.malformed == {"toggle_error": 1}


def test_two_lost_frames_are_found_by_the_checksum() -> None:
    sent = frames(fix(), number=4)
    del sent[5:7]
    reassembler = Reassembler(DATA_TYPES)
    assert not accepted(reassembler, sent)
    assert reassembler.malformed == {"bad_checksum": 1}


def test_a_lost_end_is_noticed_at_the_next_start() -> None:
    reassembler = Reassembler(DATA_TYPES)
    assert len(accepted(reassembler, frames(fix(), number=4)[:-1] + frames(fix(), number=5))) == 1
    assert reassembler.malformed == {"truncated_transfer": 1}


def test_a_lost_end_and_start_are_two_transfers_lost() -> None:
    reassembler = Reassembler(DATA_TYPES)
    assert not accepted(reassembler, frames(fix(), number=4)[:-1] + frames(fix(), number=5)[1:])
    assert reassembler.malformed == {"truncated_transfer": 1, "missing_start": 1}


def test_two_seconds_end_a_transfer() -> None:
    first, *rest = frames(fix(), number=4)
    reassembler = Reassembler(DATA_TYPES)
    reassembler.accept(first, 0)
    assert not accepted(reassembler, rest, at=TIME_OUT_NS + 1)
    assert reassembler.malformed == {"truncated_transfer": 1}
    reassembler = Reassembler(DATA_TYPES)
    reassembler.accept(first, 0)
    assert accepted(reassembler, rest, at=TIME_OUT_NS - len(rest))


def test_a_frame_delivered_twice_changes_nothing() -> None:
    reassembler = Reassembler(DATA_TYPES)
    twice = [frame for frame in frames(fix()) for _ in range(2)]
    assert len(accepted(reassembler, twice)) == 1
    assert reassembler.repeated == len(twice) // 2
    assert not reassembler.malformed


def test_the_same_reading_every_time_is_not_a_repetition() -> None:
    reassembler = Reassembler(DATA_TYPES)
    same = [frames(message("air_data.StaticPressure"), number=n % 32)[0] for n in range(100)]
    assert len(accepted(reassembler, same)) == 100


def test_a_flipped_bit_is_found() -> None:
    sent = frames(fix())
    damaged = bytes([sent[4].data[0] ^ 1]) + sent[4].data[1:]
    sent[4] = sent[4]._replace(data=damaged)
    reassembler = Reassembler(DATA_TYPES)
    assert not accepted(reassembler, sent)
    assert reassembler.malformed == {"bad_checksum": 1}


def test_a_transfer_longer_than_its_type_is_given_up() -> None:
    endless = [CanFrame(1034 << 8 | 1, bytes(7) + bytes([0x80]))]
    endless += [CanFrame(1034 << 8 | 1, bytes(7) + bytes([0x20 * (i % 2)])) for i in range(1, 1000)]
    reassembler = Reassembler(DATA_TYPES)
    assert not accepted(reassembler, endless)
    assert reassembler.malformed == {"oversize_transfer": 1}


def test_what_is_not_wanted_is_counted_apart() -> None:
    (frame,) = frames(message("air_data.StaticPressure"))
    others = [
        frame._replace(extended=False, identifier=0x123),
        frame._replace(identifier=frame.identifier | 0x80),  # a service
        frame._replace(identifier=frame.identifier & ~0x7F),  # anonymous
        frame._replace(identifier=0x1001552A),  # NodeStatus
    ]
    reassembler = Reassembler(DATA_TYPES)
    assert not accepted(reassembler, others)
    assert reassembler.ignored == 4
    assert not reassembler.malformed


def test_an_empty_frame_and_a_start_with_its_toggle_set() -> None:
    (frame,) = frames(message("air_data.StaticPressure"))
    reassembler = Reassembler(DATA_TYPES)
    reassembler.accept(frame._replace(data=b""), 0)
    reassembler.accept(frame._replace(data=frame.data[:-1] + b"\xe0"), 1)
    assert reassembler.malformed == {"empty_frame": 1, "toggle_error": 1}


def test_the_filter_admits_the_type_from_every_node_at_every_priority_and_no_service() -> None:
    identifier, mask = message_identifier(1063)
    for priority, source in itertools.product((0, 16, 31), (1, 127)):
        assert (priority << 24 | 1063 << 8 | source) & mask == identifier
    assert (1063 << 8 | 0x80 | 5) & mask != identifier
    assert (1034 << 8 | 5) & mask != identifier


IDENTIFIERS = st.one_of(
    st.integers(0, 2**29 - 1),
    st.builds(lambda kind, source: kind << 8 | source, st.sampled_from(list(DATA_TYPES)), st.integers(0, 3)),
)


@given(st.lists(st.tuples(IDENTIFIERS, st.binary(max_size=64), st.booleans(), st.booleans()), max_size=200))
@settings(max_examples=200, deadline=None)
def test_no_frames_whatever_raise_or_take_more_memory_than_their_types(
    some: list[tuple[int, bytes, bool, bool]],
) -> None:
    reassembler = Reassembler(DATA_TYPES)
    for at, (identifier, data, extended, flexible) in enumerate(some):
        reassembler.accept(CanFrame(identifier, data, extended, flexible), at * SECOND // 10)
    assert kept(reassembler) <= sum(longest(t) for t in DATA_TYPES.values()) * 128


def test_memory_is_bounded_with_every_source_in_the_middle_of_a_transfer() -> None:
    reassembler = Reassembler(DATA_TYPES)
    for at in range(3):
        for kind, source in itertools.product(DATA_TYPES, range(1, 128)):
            for toggle in (0x80, 0x20, 0x00, 0x20):
                frame = CanFrame(kind << 8 | source, bytes([at, source, 0, 0, 0, 0, 0, toggle]))
                reassembler.accept(frame, at)
    assert len(reassembler._slots) == len(DATA_TYPES) * 127
    assert kept(reassembler) <= sum(longest(t) for t in DATA_TYPES.values()) * 127


def longest(data_type: DataType) -> int:
    """Bytes that one transfer may hold on to: the payload, a checksum, the padding of CAN FD."""
    return data_type.largest + 2 + 64 + 64


def kept(reassembler: Reassembler) -> int:
    return sum(len(slot.payload) + len(slot.last_frame) for slot in reassembler._slots.values())


@given(st.randoms(use_true_random=False), st.data())
@settings(max_examples=100, deadline=None)
def test_mangled_streams_give_only_true_transfers(random: Random, data: st.DataObject) -> None:
    """Whatever happens to the frames of twenty transfers, what comes out is one of them, byte for byte."""
    sent = [frames(fix(sats_used=n), number=n % 32) for n in range(20)]
    payloads = {t.payload for number in sent for t in accepted(Reassembler(DATA_TYPES), number)}
    assert len(payloads) == 20
    mangled = [f for transfer in sent for f in transfer for _ in range(random.choice((0, 1, 1, 1, 1, 1, 2)))]
    for _ in range(data.draw(st.integers(0, 10))):
        i = random.randrange(len(mangled))
        mangled.insert(max(0, i + random.randint(-3, 3)), mangled.pop(i))
    reassembler = Reassembler(DATA_TYPES)
    found = accepted(reassembler, mangled)
    assert {t.payload for t in found} <= payloads
