"""Gaps in the numbers of hand-packed frames: what is a loss, and what only looks like one."""

from __future__ import annotations

from collections.abc import Iterable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.mavlink.frames import Frame, frame_at
from drivers.mavlink.sequence import Sequences
from drivers.sample import SECOND
from tests.drivers.mavlink.wire import attitude, frame_1, raw_frame

STEP = SECOND // 100


def framed(data: bytes) -> Frame:
    found = frame_at(data, 0)
    assert isinstance(found, Frame)
    return found


class Ear:
    """Frames in, losses out; frames come every 10 ms."""

    def __init__(self) -> None:
        self.sequences = Sequences()
        self.now = SECOND

    def hear(self, numbers: Iterable[int], component: int = 1) -> int:
        for number in numbers:
            self.now += STEP
            frame = framed(attitude(1, sequence=number % 256, component=component))
            self.sequences.heard(frame, self.now)
        return self.sequences.lost


def test_the_number_is_read_in_both_versions() -> None:
    assert framed(attitude(1, sequence=201)).sequence == 201
    assert framed(frame_1("ATTITUDE", 1, *[0.0] * 6, sequence=202)).sequence == 202


def test_a_whole_stream_lost_nothing() -> None:
    assert Ear().hear(range(77, 1_000)) == 0


@pytest.mark.parametrize(
    ("numbers", "lost"),
    [
        ((5, 6, 8), 1),
        ((5, 10, 12), 5),
        ((254, 255, 0, 1), 0),
        ((254, 0), 1),
        ((255, 1), 1),
        ((250, 3), 8),
        ((0, 129), 128),
        ((0, 130, 1), 0),  # 129 ahead is 127 behind
    ],
)
def test_gaps(numbers: tuple[int, ...], lost: int) -> None:
    assert Ear().hear(numbers) == lost


@pytest.mark.parametrize("numbers", [(5, 7, 6, 8), (255, 1, 0, 2), (4, 7, 6, 5, 8), (254, 1, 255, 0, 2)])
def test_an_overtaken_message_is_not_lost(numbers: tuple[int, ...]) -> None:
    assert Ear().hear(numbers) == 0


@pytest.mark.parametrize("numbers", [(5, 6, 6, 7), (5, 6, 7, 6, 8), (0, 0, 1), (255, 0, 1, 0, 2)])
def test_a_message_that_came_twice_hides_and_adds_nothing(numbers: tuple[int, ...]) -> None:
    assert Ear().hear(numbers) == 0


def test_what_came_twice_after_it_was_lost_counts_once() -> None:
    assert Ear().hear((5, 9, 7, 7, 10)) == 2


def test_a_loss_of_an_earlier_round_is_not_made_good_by_a_later_one() -> None:
    assert Ear().hear((4, *range(6, 256 + 6), 5)) == 1


@pytest.mark.parametrize("last", [30, 100, 127, 128, 129, 200, 230])
def test_a_boot_is_not_a_loss(last: int) -> None:
    ear = Ear()
    assert ear.hear((last - 1, last, 0, 1, 2)) == 0
    assert ear.hear((5,)) == 2  # and what follows is counted as before


def test_a_boot_whose_first_messages_went_is_not_a_loss_after_the_silence() -> None:
    ear = Ear()
    ear.hear((200, 201))
    ear.now += 5 * SECOND
    assert ear.hear((7, 8)) == 0
    assert ear.hear((10,)) == 1


def test_senders_count_each_for_themselves() -> None:
    ear = Ear()
    for number in range(300):
        ear.hear([number], component=1)
        ear.hear([number + 90], component=2)
    assert ear.sequences.lost == 0
    ear.hear([302], component=1)
    assert ear.sequences.lost == 2


def test_a_message_of_an_unknown_dialect_has_its_number() -> None:
    ear = Ear()
    ear.hear((5, 6))
    ear.sequences.passed(framed(raw_frame(0xABCDEF, 0, b"?", sequence=7)))
    assert ear.hear((8,)) == 0


def test_what_no_checksum_vouches_for_moves_nothing() -> None:
    ear = Ear()
    ear.hear((5, 6))
    ear.sequences.passed(framed(raw_frame(0xABCDEF, 0, b"?", sequence=60)))
    ear.sequences.passed(framed(raw_frame(0xABCDEF, 0, b"?", system=77)))
    assert ear.hear((7, 8)) == 0


@given(st.data())
def test_losses_at_random_are_counted_one_by_one(data: st.DataObject) -> None:
    """Bursts of up to 15, the first never lost; the oracle is how many were left out."""
    stream = [0]
    left_out = 0
    for _ in range(data.draw(st.integers(0, 60))):
        gap = data.draw(st.integers(0, 15))
        left_out += gap
        stream.append(stream[-1] + 1 + gap)
    assert Ear().hear(stream) == left_out


@given(st.lists(st.integers(0, 255), max_size=400))
def test_any_numbers_give_a_bounded_count(numbers: list[int]) -> None:
    assert 0 <= Ear().hear(numbers) <= 128 * len(numbers)
