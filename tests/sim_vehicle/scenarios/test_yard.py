"""Drives in the yard: long enough, inside it, with stops."""

from __future__ import annotations

import itertools
import math

import pytest

from sim_vehicle import scenarios
from sim_vehicle.course import CourseDriver
from sim_vehicle.world import World


@pytest.mark.parametrize("seed", range(4))
def test_a_drive_is_a_few_hundred_metres_inside_the_yard(seed: int) -> None:
    drawn = scenarios.draw("beacons", seed)
    world = World(drawn.rover, CourseDriver(drawn.course), drawn.start)
    drive = [world.at(count / 10.0) for count in range(1801)]
    length = sum(math.hypot(b.north - a.north, b.east - a.east) for a, b in itertools.pairwise(drive))
    assert 180.0 < length < 400.0
    assert max(max(abs(truth.north), abs(truth.east)) for truth in drive) < 30.0
    assert max(abs(truth.yaw_rate) for truth in drive) <= 0.7 + 1e-9


def test_the_beacons_stand_near_the_corners_on_masts() -> None:
    ranger = scenarios.draw("beacons", 9).ranger
    assert ranger is not None
    assert [site.id for site in ranger.beacons] == [0, 1, 2, 3]
    for site in ranger.beacons:
        assert 27.0 <= abs(site.north) <= 33.0
        assert 27.0 <= abs(site.east) <= 33.0
        assert -3.0 <= site.down <= -1.5
    assert {(site.north > 0.0, site.east > 0.0) for site in ranger.beacons} == set(
        itertools.product((True, False), repeat=2)
    )
