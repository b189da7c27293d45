"""How a blanking ends: against a track and a truth of whole numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from service.replay.blanking import Blank
from service.replay.outage import driven, outages_of
from service.score import Track, Truth

BEGIN = 1000.0


def truth() -> Truth:
    """Return a way of 2 m/s north for a minute."""
    time = BEGIN + np.arange(61.0)
    return Truth(time, 2.0 * (time - BEGIN), np.zeros(61))


def track(drift: float, sigma: float) -> Track:
    """Return ten estimates a second that drift off to the east."""
    time = BEGIN + 0.1 * np.arange(600.0)
    variance = np.full(600, sigma**2)
    return Track(
        time,
        2.0 * (time - BEGIN),
        drift * (time - BEGIN),
        np.column_stack([variance, np.zeros(600), variance]),
    )


def test_the_error_at_the_end_is_set_beside_the_way() -> None:
    (outage,) = outages_of(track(0.1, 1.0), truth(), [Blank.of("position:20-50")], BEGIN)
    assert outage.error_m == pytest.approx(0.1 * 49.9)
    assert outage.distance_m == pytest.approx(2.0 * 29.9)
    assert outage.share == pytest.approx(4.99 / 59.8)
    assert outage.radius_m == pytest.approx(math.sqrt(-2.0 * math.log(0.05)), rel=1e-3)
    # off by 0.1 m a second, inside while that is below 2.4477 sigma: from 20.0 to 24.4 s, 45 of 300
    assert outage.coverage_95 == pytest.approx(45 / 300)


def test_one_to_the_end_ends_with_the_log_and_one_beyond_it_says_nothing() -> None:
    blanks = [Blank.of("position:20-"), Blank.of("range:90-95")]
    (outage,) = outages_of(track(0.1, 1.0), truth(), blanks, BEGIN)
    assert outage.error_m == pytest.approx(0.1 * 59.9)


def test_who_stands_has_no_share() -> None:
    still = Truth(np.array([BEGIN, BEGIN + 60.0]), np.zeros(2), np.zeros(2))
    (outage,) = outages_of(track(0.0, 1.0), still, [Blank.of("position:1-2")], BEGIN)
    assert outage.share is None


def test_without_a_truth_there_is_nothing_to_say() -> None:
    assert outages_of(track(0.1, 1.0), None, [Blank.of("position:20-50")], BEGIN) == []


def test_the_way_is_as_long_as_its_corners_make_it() -> None:
    corner = Truth(np.array([0.0, 10.0, 20.0]), np.array([0.0, 3.0, 3.0]), np.array([0.0, 0.0, 4.0]))
    assert driven(corner, 0.0, 20.0) == pytest.approx(7.0)
    assert driven(corner, 5.0, 15.0) == pytest.approx(3.5)
