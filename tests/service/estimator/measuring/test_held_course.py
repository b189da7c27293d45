"""A course that a receiver holds: told by its repetition, and taken for no direction."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from drivers.sample import LocalPosition, Sample, Velocity
from service.config import Configuration, validated
from service.estimator import Estimator
from service.estimator.measuring.held_course import HeldCourse

SECOND = 1_000_000_000


def going(speed: float, course: float) -> tuple[float, float]:
    return speed * math.cos(course), speed * math.sin(course)


@pytest.mark.parametrize("course", [0.0, 1.2345, math.pi, -2.5])
def test_one_course_at_several_speeds_is_held(course: float) -> None:
    held = HeldCourse()
    assert [held.holds(*going(speed, course)) for speed in (0.3, 0.7, 0.05)] == [False, True, True]


def test_a_course_that_is_measured_moves_in_its_last_digit() -> None:
    """GPS_RAW_INT says hundredths of a degree."""
    held = HeldCourse()
    assert not any(held.holds(*going(0.5, math.radians(143.0 + 0.01 * (k % 2)))) for k in range(10))


def test_whoever_goes_fast_has_a_course() -> None:
    held = HeldCourse()
    assert not any(held.holds(*going(4.0, 1.0)) for _ in range(10))


def hovering(held: float) -> list[Sample]:
    """A minute of fixes and velocities of what hovers: a speed of 0.4 m/s on average, its course held so long, s."""
    random = np.random.default_rng(7)
    samples: list[Sample] = []
    course, since = 0.0, -math.inf
    for second in range(60):
        if second - since >= held:
            course, since = 2.0 + 0.1 * random.normal(), second
        time = second * SECOND
        north, east = 0.3 * random.normal(size=2)
        samples.append(Sample(time, time, "l", "fix", LocalPosition(north, east, None, 3.0)))
        speed = abs(0.5 * random.normal())
        samples.append(Sample(time, time, "l", "fix", Velocity(*going(speed, course))))
    return samples


def offset(samples: list[Sample]) -> float:
    """Return how far from its place a vehicle is believed on average over the second half of a minute, metres."""
    file: dict[str, Any] = {
        "vehicle": {"name": "drone", "motion": "constant_velocity"},
        "start": {"position": [0.0, 0.0, 0.0]},
        "loop": {"rate": 5.0, "horizon_ms": 100.0},
        "budget": {"particles_max": 2000},
        "link": [{"name": "l", "kind": "mavlink", "url": "udpin:127.0.0.1:0"}],
        "sensor": [{"kind": "position"}, {"kind": "velocity"}],
    }
    estimator = Estimator(validated(file, Configuration, "drone.toml"), seed=1)
    places: list[tuple[float, float]] = []
    for tick in range(300):
        now = tick * SECOND // 5
        estimator.ingest([sample for sample in samples if sample.time == now])
        north, east, _ = estimator.tick(now, now, 2000).position
        if tick >= 150:
            places.append((north or 0.0, east or 0.0))
    return float(np.hypot(*np.mean(places, axis=0)))


def test_what_hovers_is_not_drifted_off_by_a_held_course() -> None:
    """Held for 20 s, a course of which nothing is known leads less far off than one that is said anew each second."""
    assert offset(hovering(held=20.0)) < 1.0
    assert offset(hovering(held=1.0)) > 1.5
