from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from drivers.sample import Altitude, Heading, Pressure, Speed
from tests.drivers.mavlink.conftest import Ear
from tests.drivers.mavlink.wire import frame


@pytest.mark.parametrize("name", ["SCALED_PRESSURE", "SCALED_PRESSURE2"])
def test_hectopascal_and_hundredths_of_a_degree(ear: Ear, name: str) -> None:
    (sample,) = ear.hear(frame(name, 5_000, 945.25, 1.5, -1_050, 0))
    assert sample.reading == Pressure(pytest.approx(94_525.0), pytest.approx(150.0), pytest.approx(262.65))


def test_no_differential_sensor_is_none(ear: Ear) -> None:
    (sample,) = ear.hear(frame("SCALED_PRESSURE", 5_000, 945.25, 0.0, 2_500, 0))
    assert sample.reading == Pressure(pytest.approx(94_525.0), None, pytest.approx(298.15))


def test_no_pressure_is_refused(ear: Ear) -> None:
    assert ear.hear(frame("SCALED_PRESSURE", 5_000, 0.0, 0.0, 2_500, 0)) == []
    assert ear.hear(frame("SCALED_PRESSURE", 5_000, math.nan, 0.0, 2_500, 0)) == []
    (sample,) = ear.hear(frame("SCALED_PRESSURE", 5_000, 945.25, math.nan, 2_500, 0))
    assert isinstance(sample.reading, Pressure)
    assert sample.reading.differential is None
    assert ear.refused == {"SCALED_PRESSURE.absolute": 2, "SCALED_PRESSURE.press_diff": 1}


HUD = frame("VFR_HUD", 12.0, 3.5, 120.0, 0.1, 270, 40)


def test_the_hud_is_not_used_unless_asked(ear: Ear) -> None:
    """It repeats GNSS and the autopilot's filter: used beside them it would count twice."""
    assert ear.hear(HUD) == []


def test_what_is_asked_of_the_hud(listen: Callable[..., Ear]) -> None:
    ear = listen(hud=frozenset({"groundspeed", "altitude", "heading"}))
    samples = ear.hear(HUD)
    assert [s.reading for s in samples] == [
        Speed(pytest.approx(3.5)),
        Altitude(pytest.approx(120.0)),
        Heading(pytest.approx(-math.pi / 2)),
    ]
    assert all(s.time == s.received for s in samples)
    wrong = frame("VFR_HUD", 12.0, 3.5, 120.0, 0.1, -1, 40)
    assert len(ear.hear(wrong)) == 2
    assert ear.refused == {"VFR_HUD.heading": 1}


ALTITUDE = frame("ALTITUDE", 9_000_000, 101.0, 503.5, 3.0, 4.0, 500.0, 2.0)
GLOBAL_POSITION = frame("GLOBAL_POSITION_INT", 9_000, 470_000_000, 80_000_000, 503_500, 3_000, 0, 0, 0, 0)


def test_the_autopilots_own_altitude_is_not_used_unless_asked(ear: Ear) -> None:
    assert ear.hear(ALTITUDE, GLOBAL_POSITION) == []


def test_what_is_asked_of_the_autopilots_altitudes(listen: Callable[..., Ear]) -> None:
    """Above mean sea level, in metres and in millimetres; what says that it does not know is passed over."""
    ear = listen(altitudes=frozenset({"ALTITUDE", "GLOBAL_POSITION_INT"}))
    samples = ear.hear(ALTITUDE, GLOBAL_POSITION)
    assert [(s.source, s.reading) for s in samples] == [
        ("ALTITUDE", Altitude(pytest.approx(503.5))),
        ("GLOBAL_POSITION_INT", Altitude(pytest.approx(503.5))),
    ]
    unknown = frame("ALTITUDE", 9_100_000, 101.0, math.nan, 3.0, 4.0, 500.0, 2.0)
    nowhere = frame("GLOBAL_POSITION_INT", 9_100, 0, 0, 17_000, 3_000, 0, 0, 0, 0)
    assert ear.hear(unknown, nowhere) == []
    assert ear.passed_over == {"ALTITUDE.altitude_amsl": 1, "GLOBAL_POSITION_INT.lat": 1}
