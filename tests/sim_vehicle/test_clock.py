"""Clocks on board: uptime, drift, and the 32 bits of the wire."""

from __future__ import annotations

from sim_vehicle.clock import BoardClock


def test_a_clock_counts_from_its_boot_and_drifts() -> None:
    clock = BoardClock(uptime=100.0, drift=20e-6)
    assert clock.nanoseconds(0.0) == 100_000_000_000
    assert clock.nanoseconds(1000.0) == 1_100_020_000_000
    assert clock.microseconds(1000.0) == 1_100_020_000
    assert clock.milliseconds(1000.0) == 1_100_020


def test_milliseconds_wrap_as_a_uint32() -> None:
    clock = BoardClock(uptime=2**32 / 1000.0 - 1.0)
    assert clock.milliseconds(0.5) == 2**32 - 500
    assert clock.milliseconds(1.5) == 500


def test_before_the_boot_the_clock_stands_at_zero() -> None:
    assert BoardClock(uptime=0.1).nanoseconds(-5.0) == 0
