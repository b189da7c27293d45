"""Back-off doubles to its limit and is forgotten after health."""

from __future__ import annotations

from service.backoff import BackOff


def test_doubles_from_a_tenth_to_five_seconds() -> None:
    back_off = BackOff()
    assert [back_off.failed(0.0) for _ in range(8)] == [0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 5.0, 5.0]


def test_starts_anew_after_ten_seconds_of_health() -> None:
    back_off = BackOff()
    for _ in range(5):
        back_off.failed(9.9)
    assert back_off.failed(10.0) == 0.1
    assert back_off.failed(0.0) == 0.2
