"""How fast a vehicle may be while it is silent, and what follows for the belief."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from drivers.sample import AnyReading, MotionCommand, Rotation, Sample, Speed
from service.config import Configuration, validated
from service.estimator.ground import PERSISTENCE, GroundVehicle
from service.estimator.pace import SHOWN, UNKNOWN_SPEED, Pace

SECOND = 1_000_000_000
HZ = 10


def vehicle() -> GroundVehicle:
    return GroundVehicle(
        validated(
            {
                "vehicle": {"name": "test"},
                "start": {"position": [0.0, 0.0, 0.0], "heading": 0.0},
                "link": [{"name": "l", "kind": "mavlink", "url": "udpin:127.0.0.1:0"}],
                "sensor": [{"kind": "position"}],
            },
            Configuration,
            "test.toml",
        )
    )


class Still:
    """A belief that is only moved."""

    def predict(self, control: object, duration: float) -> None:
        """Take it."""


def drive(ground: GroundVehicle, seconds: float, *readings: AnyReading) -> int:
    """Hear ``readings`` ten times a second, move along, and return the time of the last."""
    time = 0
    for tick in range(1, int(seconds * HZ) + 1):
        time = tick * SECOND // HZ
        for reading in readings:
            ground.controls.take(Sample(time, time, "l", "wheels", reading))
        ground.predict(Still(), time - SECOND // HZ, time)
    return time


def test_who_has_not_shown_how_fast_it_is_may_be_as_fast_as_any() -> None:
    pace = Pace(2.0)
    pace.saw(0.1, SHOWN - 1.0)
    assert pace.sigma == 2.0
    pace.saw(0.0, 100.0)  # standing shows nothing
    assert pace.sigma == 2.0
    pace.saw(-0.2, 1.0)
    assert pace.sigma == pytest.approx(0.2)
    pace.saw(30.0, 1.0)
    assert pace.sigma == 2.0


def test_a_silence_widens_a_slow_robot_by_its_own_pace_only() -> None:
    """Two seconds without a word: half a second of the last speed, the rest unknown."""
    for speed, pace in ((0.08, 0.08), (5.0, UNKNOWN_SPEED)):
        ground = vehicle()
        end = drive(ground, SHOWN + 2.0, Speed(speed), Rotation(0.0))
        silent = ground.rolled(end, end + 2 * SECOND)
        assert silent.distance == pytest.approx(0.5 * speed, rel=0.01)
        spread = 2.0 * PERSISTENCE**2 * (1.5 / PERSISTENCE - 1.0 + math.exp(-1.5 / PERSISTENCE))
        assert silent.distance_sigma == pytest.approx(pace * math.sqrt(spread), rel=0.01)


def test_a_silence_widens_the_belief_alike_whatever_the_strides() -> None:
    """Against many speeds that each wander with the time constant and are added up in small steps (1 % at 2 sigma)."""
    ground = vehicle()
    end = drive(ground, 1.0, Speed(0.0), Rotation(0.0))
    marks = range(end + SECOND // 2, end + 5 * SECOND // 2 + 1, SECOND // 10)
    strides = [ground.rolled(start, stop).distance_sigma ** 2 for start, stop in pairwise(marks)]
    assert math.sqrt(sum(strides)) == pytest.approx(ground.rolled(marks[0], marks[-1]).distance_sigma)
    random = np.random.default_rng(0)
    speed, way, step = UNKNOWN_SPEED * random.normal(size=20_000), np.zeros(20_000), 0.01
    keeps = math.exp(-step / PERSISTENCE)
    for _ in range(200):
        fresh = keeps * speed + UNKNOWN_SPEED * math.sqrt(1.0 - keeps**2) * random.normal(size=speed.size)
        way += 0.5 * step * (speed + fresh)
        speed = fresh
    assert math.sqrt(sum(strides)) == pytest.approx(way.std(), rel=0.01)


def test_a_first_speed_holds_until_the_second() -> None:
    ground = vehicle()
    ground.controls.take(Sample(SECOND, SECOND, "l", "wheels", Speed(1.0)))
    assert ground.controls.distance(SECOND, 5 * SECOND // 4) == pytest.approx((0.25, 0.0, math.inf))


def test_only_what_feels_turns_has_a_bias_to_read_at_a_standstill() -> None:
    gyro, commanded = vehicle(), vehicle()
    drive(gyro, 1.0, Speed(0.0), Rotation(0.0))
    drive(commanded, 1.0, MotionCommand((0.0, 0.0, 0.0), 0.0, body=True))
    assert gyro.controls.feels_turns
    assert not commanded.controls.feels_turns
