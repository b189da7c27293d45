"""Faults happen in their windows, in their share, to their target, and are counted."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_vehicle.chance import stream
from sim_vehicle.faults import Fault, Faults, Kind, Window


def test_a_window_holds_its_start_and_not_its_stop() -> None:
    window = Window(2.0, 3.0)
    assert [window.holds(time) for time in (1.9, 2.0, 2.9, 3.0)] == [False, True, True, False]
    assert Window().holds(1e12)


def test_only_the_targets_faults_strike_and_only_in_their_window() -> None:
    faults = [Fault("can", Kind.DROP, Window(1.0, 2.0)), Fault("mavlink", Kind.REPEAT)]
    can = Faults("can", faults, stream(1, "f"))
    assert [fault.kind for fault in can.strike(1.5)] == [Kind.DROP]
    assert can.strike(2.5) == []
    assert can.counts == {Kind.DROP: 1}


def test_the_share_is_kept() -> None:
    """20,000 frames at a share of 0.1: five sigma are 212 frames; fails by chance less than once in 10^6."""
    faults = Faults("can", [Fault("can", Kind.DROP, share=0.1)], stream(2, "f"))
    struck = sum(bool(faults.strike(0.0)) for _ in range(20_000))
    assert abs(struck - 2000) < 5.0 * math.sqrt(20_000 * 0.1 * 0.9)


@given(st.binary(min_size=1, max_size=64))
def test_corruption_keeps_the_length(data: bytes) -> None:
    assert len(Faults("can", (), stream(3, "f")).corrupted(data)) == len(data)


def test_corruption_changes_at_most_three_bytes() -> None:
    faults = Faults("can", (), stream(3, "f"))
    for _ in range(200):
        changed = sum(byte != 0 for byte in faults.corrupted(bytes(40)))
        assert 0 <= changed <= 3


def test_a_share_beyond_one_is_refused() -> None:
    with pytest.raises(ValueError, match=r"fault of can: share needs to be from 0 to 1, got 1\.5"):
        Fault("can", Kind.DROP, share=1.5)
