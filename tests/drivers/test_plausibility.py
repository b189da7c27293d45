"""The limits of what a driver lets in."""

from __future__ import annotations

import math

import pytest

from drivers.plausibility import implausible
from drivers.sample import (
    ActuatorCommand,
    AnyReading,
    Attitude,
    GeodeticPosition,
    Heading,
    Inertial,
    LocalPosition,
    MotionCommand,
    Odometer,
    Presence,
    Pressure,
    Range,
)
from tests.drivers.examples import KINDS, fields, floating

HALF = math.pi / 2


@pytest.mark.parametrize(
    "reading",
    [
        GeodeticPosition(latitude=HALF, longitude=-math.pi),
        GeodeticPosition(latitude=-HALF, longitude=math.pi, altitude=-430.0, sigma_horizontal=0.01),
        Range(beacon=0, distance=0.0),
        Heading(heading=2 * math.pi),
        Odometer(distance=(-5.0, 1e8)),
        MotionCommand(velocity=(1.0, 0.0, 0.0), body=True),
        ActuatorCommand((None, -1.0, 1.0)),
        Presence(type=10, autopilot=3, armed=True, system_status=4),
    ],
)
def test_what_can_be_true(reading: AnyReading) -> None:
    assert implausible(reading) is None


@pytest.mark.parametrize(
    ("reading", "field"),
    [
        (GeodeticPosition(latitude=-35.4, longitude=1.0), "latitude"),
        (GeodeticPosition(latitude=1.0, longitude=149.0), "longitude"),
        (GeodeticPosition(latitude=1.0, longitude=1.0, sigma_horizontal=0.0), "sigma_horizontal"),
        (GeodeticPosition(latitude=1.0, longitude=1.0, altitude=-1e6), "altitude"),
        (LocalPosition(north=1e7, east=0.0), "north"),
        (Range(beacon=-1, distance=1.0), "beacon"),
        (Range(beacon=1, distance=-0.1), "distance"),
        (Range(beacon=1, distance=1.0, sigma=-1.0), "sigma"),
        (Heading(heading=270.0), "heading"),
        (Attitude(roll=0.0, pitch=0.0, yaw=90.0), "yaw"),
        (Inertial(specific_force=(0.0, math.nan, 0.0)), "specific_force"),
        (Inertial(magnetic_field=(25.0, 0.0, 0.0)), "magnetic_field"),
        (Odometer(distance=(0.0,) * 257), "distance"),
        (Pressure(absolute=0.0), "absolute"),
        (ActuatorCommand((0.0, 1.1)), "channels"),
        (Odometer(distance=(0.0,), epoch=2**63), "epoch"),
        (Presence(type=256, autopilot=3, armed=True, system_status=4), "type"),
    ],
)
def test_what_cannot(reading: AnyReading, field: str) -> None:
    assert implausible(reading) == field


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
def test_no_number_of_any_reading_may_be_other_than_finite(kind: type[AnyReading], wrong: float) -> None:
    """Every floating field of every reading, one at a time, in a reading that is otherwise plausible."""
    fine = fields(kind)
    assert implausible(kind(**fine)) is None
    for name in floating(kind):
        value = (0.5, wrong, 0.125) if isinstance(fine[name], tuple) else wrong
        assert implausible(kind(**{**fine, name: value})) == name
