"""The way seen from one moment, against a vehicle driven step by step with the biases that it really has."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drivers.sample import Inertial, Odometer, Sample
from service.config import Configuration, validated
from service.estimator.ground import GroundVehicle
from service.estimator.vehicle import vehicle_of
from service.estimator.way import ROOM, FreeWay, GroundWay, way_of

SECOND = 1_000_000_000
BIAS, SCALE = 0.02, 1.03
START = (3.0, -2.0, 2.5)


def configuration(motion: str = "unicycle") -> Configuration:
    file = {
        "vehicle": {"name": "test", "motion": motion},
        "link": [{"name": "l", "kind": "mavlink", "url": "udpin:127.0.0.1:0"}],
    }
    return validated(file, Configuration, "test.toml")


def driven(seconds: float, rate: int = 20) -> tuple[GroundWay, list[tuple[float, float, float]]]:
    """Return the way of a vehicle that reads its gyro BIAS too high and its odometer too short, and its true poses."""
    settings = configuration()
    vehicle = GroundVehicle(settings)
    way = way_of(vehicle, settings, 30.0)
    assert isinstance(way, GroundWay)
    poses = [START]
    rolled = 0.0
    step = SECOND // rate
    vehicle.controls.take(Sample(0, 0, "l", "WHEEL_DISTANCE", Odometer((0.0,))))
    vehicle.controls.take(Sample(0, 0, "l", "S", Inertial((0.0, 0.0, 0.3 + BIAS))))
    for k in range(1, round(seconds * rate) + 1):
        speed, turn = 1.0 + 0.5 * math.sin(0.1 * k), 0.3 / rate
        north, east, heading = poses[-1]
        middle = heading + 0.5 * turn
        north, east = north + speed / rate * math.cos(middle), east + speed / rate * math.sin(middle)
        poses.append((north, east, heading + turn))
        rolled += speed / rate / SCALE
        time = k * step
        vehicle.controls.take(Sample(time, time, "l", "WHEEL_DISTANCE", Odometer((rolled,))))
        vehicle.controls.take(Sample(time, time, "l", "S", Inertial((0.0, 0.0, 0.3 + BIAS))))
        way.moved(time - step, time)
    return way, poses


def test_the_way_back_and_forth_is_the_one_that_was_driven() -> None:
    """Supposed with its true biases at 3 s, the vehicle was where it was at every other time, to 5 mm of 8 m.

    The dependence on the gyro's bias is linearised: 0.02 rad/s over 5 s is 0.1 rad, whose square half is 5 mm a metre.
    """
    way, poses = driven(8.0)
    moment, times = 3 * SECOND, [k * SECOND // 2 for k in range(1, 17)]
    at = poses[60]
    columns = dict(
        zip(("north", "east", "heading"), (np.array([x]) for x in at), strict=True),
        gyro_bias=np.array([BIAS]),
        odometry_scale=np.array([SCALE]),
    )
    found = way.shape(moment, times).poses(columns)
    for index, time in enumerate(times):
        north, east, heading = poses[time * 20 // SECOND]
        assert found.north[index, 0] == pytest.approx(north, abs=0.05)
        assert found.east[index, 0] == pytest.approx(east, abs=0.05)
        assert found.heading[index, 0] == pytest.approx(heading, abs=1e-6)


def test_the_variance_grows_either_way_from_the_moment_and_is_none_at_it() -> None:
    way, _ = driven(8.0)
    shape = way.shape(4 * SECOND, [SECOND, 3 * SECOND, 4 * SECOND, 5 * SECOND, 8 * SECOND])
    assert shape.variance[2] == 0.0
    assert shape.turn_variance[2] == 0.0
    assert shape.reach[2] == 0.0
    assert shape.variance[0] > shape.variance[1] > 0.0
    assert shape.variance[4] > shape.variance[3] > 0.0
    assert shape.turn_variance[3] == pytest.approx(0.02**2 + 0.01**2 * 0.32, rel=0.02)


def test_before_anything_moved_the_way_is_no_way() -> None:
    settings = configuration()
    shape = GroundWay(GroundVehicle(settings), settings, 30.0).shape(5 * SECOND, [SECOND, 5 * SECOND])
    assert not shape.reach.any()
    assert not shape.variance.any()


def test_the_memory_is_bounded_and_keeps_the_newest() -> None:
    settings = configuration()
    way = GroundWay(GroundVehicle(settings), settings, 10.0)
    for k in range(3 * ROOM):
        way.moved(k * SECOND // 100, (k + 1) * SECOND // 100)
    end = 3 * ROOM * SECOND // 100
    shape = way.shape(end, [end - 5 * SECOND])
    assert shape.turn_variance[0] > 0.9 * 5 * 0.02**2


def test_a_free_vehicle_keeps_its_velocity() -> None:
    settings = configuration("constant_velocity")
    way = way_of(vehicle_of(settings), settings, 10.0)
    assert isinstance(way, FreeWay)
    way.moved(0, SECOND)
    shape = way.shape(2 * SECOND, [0, 3 * SECOND])
    columns = {
        "north": np.array([1.0, 2.0]),
        "east": np.array([0.0, 0.0]),
        "heading": np.zeros(2),
        "velocity_north": np.array([1.0, 0.0]),
        "velocity_east": np.array([0.0, -2.0]),
    }
    poses = shape.poses(columns)
    assert poses.north.tolist() == [[-1.0, 2.0], [2.0, 2.0]]
    assert poses.east.tolist() == [[0.0, 4.0], [0.0, -2.0]]
    noise = settings.motion.acceleration_noise
    assert shape.variance.tolist() == pytest.approx([noise**2 * 8 / 3, noise**2 / 3])
