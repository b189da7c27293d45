"""What repeated sights are worth, named and told apart by where they are seen."""

from __future__ import annotations

import math

import pytest

from drivers.sample import MotionCommand, Sample
from service.config import Sensor
from service.estimator.controls import Controls
from service.estimator.measuring.sightings import LEAST, MOST, Sightings

SECOND = 1_000_000_000
SIGMAS = (0.1, 0.02)


def sightings(correlation: float | None = 4.0) -> Sightings:
    return Sightings(Sensor(kind="range_bearing", correlation_s=correlation))


def driven(speed: float, turn: float, seconds: float) -> Controls:
    controls = Controls()
    for tick in range(int(seconds * 10) + 1):
        time = tick * SECOND // 10
        controls.take(Sample(time, time, "l", "drive", MotionCommand((speed, 0.0, 0.0), turn, body=True)))
    return controls


def seen(pose: tuple[float, float, float], place: tuple[float, float]) -> tuple[float, float]:
    """Distance and bearing of ``place`` from ``pose`` (north, east, heading)."""
    north, east = place[0] - pose[0], place[1] - pose[1]
    return math.hypot(north, east), math.atan2(east, north) - pose[2]


def test_a_name_is_worth_the_share_of_the_time_that_passed() -> None:
    memory = sightings()
    assert memory.share(0, 7) == 1.0
    assert memory.share(SECOND, 7) == pytest.approx(0.25)
    assert memory.share(SECOND, 8) == 1.0
    assert memory.share(3 * SECOND, 7) == pytest.approx(0.5)
    assert memory.share(3 * SECOND, 7) == LEAST
    assert memory.share(20 * SECOND, 8) == 1.0


@pytest.mark.parametrize("correlation", [None, 0.0])
def test_without_correlation_every_sight_counts(correlation: float | None) -> None:
    memory = sightings(correlation)
    assert [memory.share(time, 7) for time in range(3)] == [1.0] * 3
    controls = driven(0.0, 0.0, 1.0)
    assert [memory.share_unnamed(time, (2.0, 0.1), SIGMAS, controls) for time in range(3)] == [1.0] * 3


def test_a_thing_without_a_name_is_known_by_where_it_is_expected_now() -> None:
    """On a circle of 2 m, north at the start, clockwise: what stands still is the same thing wherever it is seen."""
    speed, turn = 0.5, 0.25
    controls, memory = driven(speed, turn, 4.0), sightings()
    shares: list[tuple[float, float]] = []
    for second in (1, 2, 3):
        angle = turn * second
        radius = speed / turn
        pose = (radius * math.sin(angle), radius * (1.0 - math.cos(angle)), angle)
        shares.append(
            (
                memory.share_unnamed(second * SECOND, seen(pose, (5.0, 1.0)), SIGMAS, controls),
                memory.share_unnamed(second * SECOND, seen(pose, (4.0, 4.0)), SIGMAS, controls),
            )
        )
    assert shares == [(1.0, 1.0), *[pytest.approx((0.25, 0.25))] * 2]


def test_one_picture_shows_a_thing_once() -> None:
    """Two that stand side by side, nearer than anyone could tell them apart from one picture to the next."""
    controls, memory = driven(0.0, 0.0, 2.0), sightings()
    first = [memory.share_unnamed(0, (2.0, bearing), SIGMAS, controls) for bearing in (0.1, 0.12)]
    second = [memory.share_unnamed(SECOND, (2.0, bearing), SIGMAS, controls) for bearing in (0.1, 0.12)]
    assert first == [1.0, 1.0]
    assert second == [pytest.approx(0.25)] * 2


def test_bearings_alone_are_told_apart_by_their_direction() -> None:
    turn = 0.2
    controls, memory = driven(1.0, turn, 2.0), sightings()
    assert memory.share_unnamed(0, (None, 0.5), (0.0, 0.02), controls) == 1.0
    assert memory.share_unnamed(SECOND, (None, 0.5 - turn), (0.0, 0.02), controls) == pytest.approx(0.25)
    assert memory.share_unnamed(SECOND, (None, 0.5), (0.0, 0.02), controls) == 1.0


def test_its_memory_is_bounded() -> None:
    memory = sightings()
    for name in range(MOST + 1):
        assert memory.share(name, name) == 1.0
    assert memory.share(MOST + 1, 0) == 1.0  # forgotten for the others
    assert memory.share(MOST + 2, MOST) == LEAST
