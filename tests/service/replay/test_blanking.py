"""Blanking: what is taken away, from when to when, and what a user may write."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.sample import AnyReading, GeodeticPosition, LocalPosition, Odometer, Range, Sample, Velocity
from service.replay.blanking import Blank, Seeing

SECOND = 1_000_000_000


def sample(seconds: float, reading: AnyReading, source: str = "GPS_RAW_INT") -> Sample:
    received = 1_000 * SECOND + round(seconds * SECOND)
    return Sample(received - SECOND, received, "autopilot", source, reading)


def left(samples: list[Sample], *texts: str) -> list[float]:
    seen = Seeing([Blank.of(text) for text in texts])
    times = [(s.received - samples[0].received) / SECOND for s in filter(seen, samples)]
    assert seen.hidden == len(samples) - len(times)
    return times


def test_a_kind_is_taken_away_from_its_first_second_up_to_its_last() -> None:
    fixes = [sample(second, LocalPosition(0.0, 0.0)) for second in range(6)]
    assert left(fixes, "position:2-4") == [0, 1, 4, 5]
    assert left(fixes, "position:2-4", "position:5-") == [0, 1, 4]


def test_only_what_is_named_is_taken_away() -> None:
    readings = (GeodeticPosition(0.1, 0.1), Velocity(1.0, 0.0), Odometer((1.0,)), Range(1, 5.0))
    samples = [sample(0.0, Odometer((0.0,)))] + [sample(1.0, reading) for reading in readings]
    assert len(left(samples, "position:0-9")) == 4
    assert len(left(samples, "velocity:0-9")) == 4
    assert len(left(samples, "range:0-9", "position:0-9")) == 3
    assert left(samples, "GPS2_RAW:0-9") == [0.0, 1.0, 1.0, 1.0, 1.0]
    assert left(samples, "GPS_RAW_INT:1-9") == [0.0]


@pytest.mark.parametrize(
    "text", ["", "position", "position:20", "position:a-b", "position:50-20", "position:-5"]
)
def test_what_says_no_time_is_refused_with_what_would_be_right(text: str) -> None:
    with pytest.raises(ValueError, match=r"--blank: needs .*got"):
        Blank.of(text)


@given(
    st.floats(0, 1e6).map(lambda value: round(value, 3)),
    st.floats(0.001, 1e6).map(lambda value: round(value, 3)),
)
def test_what_is_written_is_read(first: float, length: float) -> None:
    last = first + length
    blank = Blank.of(f"GPS_RAW_INT:{first:.3f}-{last:.3f}")
    assert blank.what == "GPS_RAW_INT"
    assert math.isclose(blank.first, first, abs_tol=1e-3)
    assert math.isclose(blank.last, last, abs_tol=1e-3)
