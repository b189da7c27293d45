"""Where a replay may begin that has only beacons to begin from."""

from __future__ import annotations

import pytest

from drivers.sample import BeaconPlace
from service.config import Beacon
from service.replay.surroundings import area_about, beacons_of


def test_heights_are_taken_from_their_mean() -> None:
    beacons = beacons_of([BeaconPlace(7, 1.0, 2.0, 3.0), BeaconPlace(2, -1.0, 0.0, 1.0)])
    assert [beacon.id for beacon in beacons] == [2, 7]
    assert [beacon.position for beacon in beacons] == [(-1.0, 0.0, -1.0), (1.0, 2.0, 1.0)]
    assert beacons_of([]) == ()


def test_the_area_reaches_as_far_as_was_usually_heard() -> None:
    """97 of 100 ranges are within 10 m; three reflections do not widen it."""
    beacons = [Beacon(id=1, position=(0.0, -5.0, 0.0)), Beacon(id=2, position=(20.0, 5.0, 0.0))]
    area = area_about(beacons, [10.0] * 97 + [400.0] * 3)
    assert area is not None
    assert area.north == pytest.approx((-10.0, 30.0))
    assert area.east == pytest.approx((-15.0, 15.0))


def test_without_places_or_ranges_there_is_no_area() -> None:
    assert area_about([Beacon(id=1, position=(0.0, 0.0, 0.0))], []) is None
    assert area_about([], [5.0]) is None
    assert area_about([Beacon(id=1, latitude=1.0, longitude=1.0, altitude=0.0)], [5.0]) is None
