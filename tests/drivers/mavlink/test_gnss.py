from __future__ import annotations

import math

import pytest

from drivers.sample import GeodeticPosition, Heading, Origin, Velocity
from tests.drivers.mavlink.conftest import Ear
from tests.drivers.mavlink.wire import frame, gps


def test_a_fix_is_position_and_velocity(ear: Ear) -> None:
    position, velocity = ear.hear(gps())
    assert position.reading == GeodeticPosition(
        pytest.approx(math.radians(40.4433)),
        pytest.approx(math.radians(-79.9436)),
        pytest.approx(300.5),
        pytest.approx(0.9),
        pytest.approx(1.7),
        12,
    )
    assert isinstance(velocity.reading, Velocity)
    assert velocity.reading.north == pytest.approx(0.0, abs=1e-12)
    assert velocity.reading.east == pytest.approx(1.5)
    assert velocity.reading.down is None
    assert velocity.reading.sigma == pytest.approx(0.3)
    assert position.time == velocity.time <= position.received


def test_dilution_is_not_an_accuracy(ear: Ear) -> None:
    """h_acc 0 is absent (an extension); eph is a dilution, so there is no sigma at all."""
    position, velocity = ear.hear(gps(h_acc=0, v_acc=0, vel_acc=0))
    assert isinstance(position.reading, GeodeticPosition)
    assert position.reading.sigma_horizontal is None
    assert position.reading.sigma_vertical is None
    assert isinstance(velocity.reading, Velocity)
    assert velocity.reading.sigma is None


@pytest.mark.parametrize("fix", [0, 1])
def test_no_fix_is_no_sample(ear: Ear, fix: int) -> None:
    assert ear.hear(gps(fix=fix)) == []
    assert ear.passed_over == {"GPS_RAW_INT.fix_type": 1}
    assert ear.refused == {}


def test_a_flat_fix_has_no_altitude(ear: Ear) -> None:
    position, _ = ear.hear(gps(fix=2))
    assert isinstance(position.reading, GeodeticPosition)
    assert position.reading.altitude is None
    assert position.reading.sigma_vertical is None


def test_a_frozen_fix_is_used_once(ear: Ear) -> None:
    assert len(ear.hear(gps(time_usec=5_000_000))) == 2
    assert ear.hear(gps(time_usec=5_000_000)) == []
    assert len(ear.hear(gps(time_usec=5_200_000))) == 2
    assert ear.passed_over == {"GPS_RAW_INT.time_usec": 1}
    assert ear.refused == {}


def test_a_receiver_without_a_clock_is_timed_by_arrival(ear: Ear) -> None:
    for _ in range(2):
        (position, _velocity) = ear.hear(gps(time_usec=0))
        assert position.time == position.received


def test_null_island_is_not_a_place_to_be(ear: Ear) -> None:
    (only,) = ear.hear(gps(lat=0, lon=0))
    assert isinstance(only.reading, Velocity)
    assert ear.refused == {"GPS_RAW_INT.lat": 1}


def test_sentinels_are_unknown(ear: Ear) -> None:
    (position,) = ear.hear(gps(time_usec=1_000_000, vel=0xFFFF, satellites=255))
    assert isinstance(position.reading, GeodeticPosition)
    assert position.reading.satellites is None
    assert len(ear.hear(gps(time_usec=2_000_000, cog=0xFFFF))) == 1
    assert len(ear.hear(gps(time_usec=3_000_000, h_acc=0xFFFFFFFF))) == 2
    assert ear.refused == {}


def test_positions_off_the_earth_are_refused(ear: Ear) -> None:
    (velocity,) = ear.hear(gps(lat=900_000_001))
    assert isinstance(velocity.reading, Velocity)
    assert ear.refused == {"GPS_RAW_INT.latitude": 1}


@pytest.mark.parametrize(
    ("yaw", "heading"), [(36_000, 0.0), (9_000, math.pi / 2), (27_000, -math.pi / 2), (1, math.radians(0.01))]
)
def test_yaw_of_two_antennas(ear: Ear, yaw: int, heading: float) -> None:
    *_, last = ear.hear(gps(yaw=yaw, hdg_acc=50_000))
    assert last.reading == Heading(pytest.approx(heading, abs=1e-12), pytest.approx(math.radians(0.5)))


@pytest.mark.parametrize("yaw", [0, 0xFFFF])
def test_no_yaw(ear: Ear, yaw: int) -> None:
    assert len(ear.hear(gps(yaw=yaw))) == 2
    assert ear.refused == {}


def test_directions_beyond_a_turn_are_refused(ear: Ear) -> None:
    (position,) = ear.hear(gps(cog=36_001, yaw=36_001))
    assert isinstance(position.reading, GeodeticPosition)
    assert ear.refused == {"GPS_RAW_INT.cog": 1, "GPS_RAW_INT.yaw": 1}


def test_the_second_receiver_is_its_own(ear: Ear) -> None:
    second = frame(
        "GPS2_RAW",
        *(5_000_000, 404_433_000, -799_436_000, 300_500, 0, 121, 200, 150, 9_000, 3, 12, 0),
        *(36_000, 0, 900, 1_700, 300, 0),
    )
    ear.hear(gps(time_usec=5_000_000))
    samples = ear.hear(second)
    assert [type(s.reading) for s in samples] == [GeodeticPosition, Velocity, Heading]
    assert samples[0].source == "GPS2_RAW"
    assert samples[2].reading == Heading(pytest.approx(0.0, abs=1e-12))


def test_the_origin(ear: Ear) -> None:
    (sample,) = ear.hear(frame("GPS_GLOBAL_ORIGIN", -353_632_610, 1_491_652_299, 584_000, 0))
    assert sample.reading == Origin(
        pytest.approx(math.radians(-35.363261)),
        pytest.approx(math.radians(149.1652299)),
        pytest.approx(584.0),
    )
    assert ear.hear(frame("GPS_GLOBAL_ORIGIN", 0, 0, 0, 0)) == []
    assert ear.passed_over == {"GPS_GLOBAL_ORIGIN.latitude": 1}
    assert ear.refused == {}
