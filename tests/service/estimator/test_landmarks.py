"""Landmarks through the whole estimator: a robot that circles among them, with names and without."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.sample import AnyReading, Bearing, RangeBearing, Rotation, Sample, Speed
from service.config import Configuration, ConfigurationError, load
from service.estimate import Estimate
from service.estimator import Estimator

Array = NDArray[np.float64]
SECOND = 1_000_000_000
MAP = {3: (6.0, 0.0), 4: (0.0, 7.0), 8: (-6.0, -2.0), 11: (1.0, -6.0)}
SPEED, TURN = 1.0, 0.25

TEXT = """
[vehicle]
name = "robot"
[start]
position = [0.0, -4.0, 0.0]
heading = 0.0
[[link]]
name = "samples"
kind = "zenoh"
[[sensor]]
kind = "{kind}"
association = "{association}"
sigma = {sigma}
[map]
landmarks = "landmarks.csv"
"""


def configured(folder: Path, kind: str, association: str, sigma: float) -> Configuration:
    lines = "".join(f"{number},{north},{east}\n" for number, (north, east) in MAP.items())
    (folder / "landmarks.csv").write_text("id,north,east\n" + lines)
    (folder / "robot.toml").write_text(TEXT.format(kind=kind, association=association, sigma=sigma))
    return load(folder / "robot.toml")


def truth(seconds: float) -> tuple[float, float, float]:
    """On a circle of 4 m about the origin, from the west, clockwise."""
    heading = TURN * seconds
    radius = SPEED / TURN
    return radius * math.sin(heading), -radius * math.cos(heading), heading


def error(estimate: Estimate, north: float, east: float) -> float:
    """How far off it is, metres; 0 before it began."""
    if estimate.position[0] is None or estimate.position[1] is None:
        return 0.0
    return math.hypot(estimate.position[0] - north, estimate.position[1] - east)


def run(
    configuration: Configuration, kind: str, name: bool, seconds: float
) -> tuple[Estimator, float, float]:
    """Drive, and return the estimator, the largest error of its last ten seconds (m), and its share of tracking."""
    random = np.random.default_rng(4)
    estimator = Estimator(configuration, seed=1)
    worst, tracking, ticks = 0.0, 0, int(seconds * 25)
    for tick in range(ticks):
        now = (100 + tick) * SECOND // 25
        readings: list[AnyReading] = [Speed(SPEED), Rotation(TURN)]
        north, east, heading = truth(tick / 25)
        if tick % 5 == 0:
            number = list(MAP)[tick // 5 % len(MAP)]
            way = MAP[number][0] - north, MAP[number][1] - east
            bearing = math.atan2(way[1], way[0]) - heading + 0.05 * random.standard_normal()
            bearing = math.remainder(bearing, math.tau)
            distance = math.hypot(*way) + 0.2 * random.standard_normal()
            said = number if name else None
            readings.append(
                Bearing(bearing, said) if kind == "bearing" else RangeBearing(distance, bearing, said)
            )
        estimator.ingest(Sample(now, now, "samples", "robot", reading) for reading in readings)
        estimate = estimator.tick(now, now, 600)
        tracking += estimate.health == "tracking"
        if tick > ticks - 250:
            worst = max(worst, error(estimate, north, east))
    return estimator, worst, tracking / ticks


@pytest.mark.parametrize(
    ("kind", "association", "sigma"),
    [("range_bearing", "known", 0.2), ("range_bearing", "unknown", 0.2), ("bearing", "known", 0.05)],
)
def test_a_robot_knows_its_place_by_landmarks(
    kind: str, association: str, sigma: float, tmp_path: Path
) -> None:
    """Within half a metre at 25 Hz after 20 s; without names the readings have none. A fixed seed."""
    configuration = configured(tmp_path, kind, association, sigma)
    _, worst, tracking = run(configuration, kind, association == "known", 20.0)
    assert worst < 0.5
    assert tracking > 0.7


CLUTTERED = """
[[sensor]]
kind = "range_bearing"
association = "unknown"
sigma = 0.2
outliers = 0.4
"""


def seen(place: tuple[float, float], pose: tuple[float, float, float], noise: Array) -> RangeBearing:
    """What stands at ``place``, seen from ``pose`` without a name: distances to 0.2 m, directions to 0.05 rad."""
    north, east = place[0] - pose[0], place[1] - pose[1]
    bearing = math.remainder(math.atan2(east, north) - pose[2] + 0.05 * noise[1], math.tau)
    return RangeBearing(math.hypot(north, east) + 0.2 * noise[0], bearing)


def circling(seconds: float) -> tuple[float, float]:
    """Where another robot is that circles the other way."""
    return 2.0 * math.cos(0.4 * seconds), -2.0 * math.sin(0.4 * seconds)


def drive_among_robots(
    folder: Path, seed: int, carried: float = 0.0, other: Callable[[float], tuple[float, float]] = circling
) -> list[tuple[float, str, float]]:
    """Drive for 30 s, return time (s), health and error (m) of each tick.

    From 8 to 18 s nothing is seen but the ``other`` robot. If ``carried`` is not 0, the robot itself is set down at
    8 s, so many seconds ahead on its circle, and sees landmarks only.
    """
    configuration = configured(folder, "range_bearing", "unknown", 0.2)
    text = (folder / "robot.toml").read_text()
    (folder / "robot.toml").write_text(
        text.split("[[sensor]]")[0] + CLUTTERED + "[map]" + text.split("[map]")[1]
    )
    configuration = load(folder / "robot.toml")
    random = np.random.default_rng(seed)
    estimator = Estimator(configuration, seed=seed)
    told: list[tuple[float, str, float]] = []
    for tick in range(30 * 25):
        now, seconds = (100 + tick) * SECOND // 25, tick / 25
        pose = truth(seconds + (carried if seconds >= 8.0 else 0.0))
        readings: list[AnyReading] = [Speed(SPEED), Rotation(TURN)]
        if tick % 5 == 0:
            place = list(MAP.values())[tick // 5 % len(MAP)]
            if 8.0 <= seconds < 18.0 and not carried:
                place = other(seconds)
            readings.append(seen(place, pose, random.standard_normal(2)))
        estimator.ingest(Sample(now, now, "samples", "robot", reading) for reading in readings)
        estimate = estimator.tick(now, now, 600)
        told.append((seconds, str(estimate.health.value), error(estimate, pose[0], pose[1])))
    return told


def test_a_robot_that_sees_only_robots_is_not_lost(tmp_path: Path) -> None:
    """Two fifths of the sights were said to be of no landmark: ten seconds of them are a silence, no contradiction."""
    told = drive_among_robots(tmp_path, 1)
    assert all(health != "lost" for _, health, _ in told)
    assert sum(health == "dead_reckoning" for seconds, health, _ in told if 12.0 < seconds < 18.0) > 100
    assert told[-1][1] == "tracking"
    assert max(away for _, _, away in told) < 1.0


@pytest.mark.parametrize(("seed", "north", "east"), [(3, 0.0, 0.0), (4, -7.0, 4.0)])
def test_a_robot_that_is_parked_where_no_landmark_is_moves_nothing(
    seed: int, north: float, east: float, tmp_path: Path
) -> None:
    """There is a place from which it would be a landmark, all the time: by itself that is no reason to believe it."""
    told = drive_among_robots(tmp_path, seed, other=lambda _seconds: (north, east))
    assert max(away for _, _, away in told) < 1.0
    assert told[-1][1] == "tracking"


def test_a_robot_that_is_carried_away_among_robots_is_found(tmp_path: Path) -> None:
    """What it sees then fits another place: within five seconds it trusts its own no more, within twelve it knows."""
    told = drive_among_robots(tmp_path, 1, carried=9.0)
    assert max(away for seconds, _, away in told if seconds < 8.0) < 0.6
    assert all(health != "tracking" for seconds, health, away in told if seconds > 13.0 and away > 0.6)
    assert max(away for seconds, _, away in told if seconds > 20.0) < 0.6
    assert told[-1][1] == "tracking"


def test_a_landmark_not_in_the_map_or_without_a_name_is_refused_with_a_reason(tmp_path: Path) -> None:
    estimator, _, _ = run(configured(tmp_path, "range_bearing", "known", 0.2), "range_bearing", True, 2.0)
    now = 10 * SECOND
    strangers = [RangeBearing(3.0, 0.1, 99), RangeBearing(3.0, 0.1)]
    estimator.ingest(Sample(now, now, "samples", "robot", reading) for reading in strangers)
    estimator.tick(now + SECOND, now + SECOND, 600)
    (status,) = [status for status in estimator.sensors(now) if status.name.startswith("range_bearing")]
    assert status.refused["no_landmark"] == 1
    assert status.refused["no_name"] == 1


def test_a_sensor_of_landmarks_needs_a_map_and_a_map_must_be_one(tmp_path: Path) -> None:
    configured(tmp_path, "bearing", "known", 0.05)
    path = tmp_path / "robot.toml"
    text = path.read_text()
    path.write_text(text.split("[map]")[0])
    with pytest.raises(ConfigurationError, match=r"needs \[map\] landmarks"):
        load(path)
    path.write_text(text)
    (tmp_path / "landmarks.csv").write_text("id,north,east\n3,here,there\n")
    with pytest.raises(ConfigurationError, match="line 2: needs a whole number"):
        load(path)
    (tmp_path / "landmarks.csv").unlink()
    with pytest.raises(ConfigurationError, match="needs a file that exists"):
        load(path)
