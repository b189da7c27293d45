from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from drivers.sample import Clearance, Range
from tests.drivers.mavlink.conftest import Ear
from tests.drivers.mavlink.wire import beacon, frame


def distance(
    current: int, low: int = 20, high: int = 4_000, covariance: int = 255, quality: int = 0
) -> bytes:
    return frame("DISTANCE_SENSOR", 6_000, low, high, current, 0, 1, 25, covariance, *[0.0] * 6, quality)


def test_a_range_without_a_place(ear: Ear) -> None:
    (sample,) = ear.hear(beacon())
    assert sample.reading == Range(7, pytest.approx(12.345), pytest.approx(0.5))


def test_a_range_with_a_place_above_the_sea(ear: Ear) -> None:
    (sample,) = ear.hear(beacon(lat=404_435_428, lon=-799_439_963, alt=301.5, alt_type=1))
    reading = sample.reading
    assert isinstance(reading, Range)
    assert reading.latitude == pytest.approx(math.radians(40.4435428))
    assert reading.longitude == pytest.approx(math.radians(-79.9439963))
    assert reading.altitude == pytest.approx(301.5)


def test_an_altitude_above_the_ellipsoid_needs_the_geoid(ear: Ear, listen: Callable[..., Ear]) -> None:
    placed = beacon(lat=404_435_428, lon=-799_439_963, alt=301.5, alt_type=0)
    (unknown,) = ear.hear(placed)
    (known,) = listen(geoid_height=-33.5).hear(placed)
    assert isinstance(unknown.reading, Range)
    assert unknown.reading.altitude is None
    assert unknown.reading.latitude is not None
    assert isinstance(known.reading, Range)
    assert known.reading.altitude == pytest.approx(335.0)


@pytest.mark.parametrize("range_mm", [0, 0xFFFFFFFF])
def test_no_range_is_passed_over(ear: Ear, range_mm: int) -> None:
    assert ear.hear(beacon(range_mm=range_mm)) == []
    assert ear.passed_over == {"RANGING_BEACON.range": 1}
    assert ear.refused == {}


@pytest.mark.parametrize("accuracy", [0, 0xFFFFFFFF])
def test_an_unknown_accuracy_is_none(ear: Ear, accuracy: int) -> None:
    (sample,) = ear.hear(beacon(accuracy=accuracy))
    assert sample.reading == Range(7, pytest.approx(12.345))


def test_an_altitude_of_no_known_frame_is_refused(ear: Ear) -> None:
    (sample,) = ear.hear(beacon(lat=1, lon=2, alt=5.0, alt_type=9))
    assert isinstance(sample.reading, Range)
    assert sample.reading.altitude is None
    assert ear.refused == {"RANGING_BEACON.alt_type": 1}


def test_a_clearance(ear: Ear) -> None:
    (sample,) = ear.hear(distance(150, covariance=16))
    assert sample.reading == Clearance(pytest.approx(1.5), 25, pytest.approx(0.04))


@pytest.mark.parametrize("covariance", [0, 255])
def test_an_unknown_covariance_is_none(ear: Ear, covariance: int) -> None:
    (sample,) = ear.hear(distance(150, covariance=covariance))
    assert sample.reading == Clearance(pytest.approx(1.5), 25)


@pytest.mark.parametrize("current", [0, 19, 20, 4_000, 4_001, 0xFFFF])
def test_a_limit_is_no_distance(ear: Ear, current: int) -> None:
    """Out of range is reported as the limit, not left out."""
    assert ear.hear(distance(current)) == []
    assert ear.passed_over == {"DISTANCE_SENSOR.out_of_range": 1}
    assert ear.refused == {}


def test_a_sensor_without_limits_is_used(ear: Ear) -> None:
    assert len(ear.hear(distance(9_000, low=0, high=0))) == 1


def test_an_invalid_signal_is_passed_over(ear: Ear) -> None:
    assert ear.hear(distance(150, quality=1)) == []
    assert len(ear.hear(distance(150, quality=100))) == 1
    assert ear.passed_over == {"DISTANCE_SENSOR.signal_quality": 1}
    assert ear.refused == {}
