"""Whatever samples and clocks say, the estimator raises nothing, publishes only numbers, and stays small.

In the daemon an exception inside a tick ends the loop, and a number that is not finite would stay in the belief for
ever. The drivers refuse what cannot be true; here it comes all the same.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import msgspec
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.sample import (
    ActuatorCommand,
    Altitude,
    AnyReading,
    Attitude,
    Clearance,
    GeodeticPosition,
    Heading,
    Inertial,
    LocalPosition,
    MotionCommand,
    MotorSpeed,
    Odometer,
    Origin,
    Presence,
    Pressure,
    Range,
    Rotation,
    Sample,
    Speed,
    Velocity,
)
from service.config import Configuration, validated
from service.estimate import Estimate
from service.estimator import Estimator

SECOND = 1_000_000_000
MS = 1_000_000
START = 1000 * SECOND


def configuration(**sections: Any) -> Configuration:
    file: dict[str, Any] = {
        "vehicle": {"name": "test"},
        "link": [{"name": "l", "kind": "mavlink", "url": "udpin:127.0.0.1:0"}],
        "budget": {"particles_min": 20, "particles_max": 300},
        "motion": {"wheel_radius": 0.1, "wheel_track": 0.5, "throttle_channel": 1},
        "sensor": [
            {"kind": "position"},
            {"kind": "velocity", "delay_ms": 90.0},
            {"kind": "range", "estimate": ["scale", "bias"]},
            {"kind": "heading", "delay_ms": 5000.0, "link": "l"},
        ],
        "beacon": [{"id": 0, "position": [0.0, 0.0, 0.0]}, {"id": 1, "position": [0.0, 0.0, 0.0]}],
    }
    return validated(file | sections, Configuration, "test.toml")


HERE = {"latitude": 51.0, "longitude": 180.0}
CONFIGURATIONS = (
    configuration(origin=HERE, start={"position": [0.0, 0.0, 0.0], "sigma": [0.0, 0.0, 0.0]}),
    configuration(start={"mode": "first_fix"}),
    configuration(
        start={"mode": "global"},
        area={"north": [-50.0, 50.0], "east": [-50.0, 50.0]},
        sensor=[{"kind": kind, "outliers": 0.0} for kind in ("position", "velocity", "range", "heading")],
        loop={"horizon_ms": 0.0},
    ),
    configuration(start={"mode": "first_fix"}, budget={"particles_min": 10, "particles_max": 10}),
)

number = st.one_of(
    st.floats(-10.0, 10.0),
    st.sampled_from((0.0, -0.0, 1e-300, -1e-9, 1e-9, 1e3, -1e6, 1e9, 1e38, -1e200, 1.7e308)),
    st.sampled_from((math.nan, math.inf, -math.inf)),
)
maybe = st.one_of(st.none(), number)
vector = st.tuples(number, number, number)
maybe_vector = st.one_of(st.none(), vector)
small = st.integers(0, 3)

KINDS: tuple[st.SearchStrategy[AnyReading], ...] = (
    st.builds(GeodeticPosition, number, number, maybe, maybe, maybe),
    st.builds(LocalPosition, number, number, maybe, maybe, maybe),
    st.builds(Velocity, number, number, maybe, maybe),
    st.builds(Speed, number),
    st.builds(Odometer, st.lists(number, max_size=3).map(tuple), small),
    st.builds(Inertial, maybe_vector, maybe_vector, maybe_vector),
    st.builds(Rotation, number),
    st.builds(Attitude, number, number, number, maybe_vector),
    st.builds(Heading, number, maybe),
    st.builds(Range, st.integers(0, 2**31), number, maybe, maybe, maybe, maybe),
    st.builds(Range, small, st.floats(0.1, 100.0)),
    st.builds(Clearance, number, small),
    st.builds(Pressure, number),
    st.builds(Altitude, number),
    st.builds(MotorSpeed, small, number),
    st.builds(Origin, number, number, number),
    st.builds(Presence, small, small, st.booleans(), small),
    st.builds(MotionCommand, maybe_vector, maybe, st.booleans()),
    st.builds(ActuatorCommand, st.lists(maybe, max_size=2).map(tuple)),
)

offset = st.one_of(
    st.integers(-400 * MS, 60 * MS),
    st.sampled_from((0, 1, -1, 50 * MS, 51 * MS, -60 * SECOND, 10 * SECOND, -(2**61), 2**61)),
)


class Step(NamedTuple):
    """So much later these arrive (reading, stamp and arrival after now, source), and a tick affords so many."""

    later: int
    arrivals: list[tuple[AnyReading, int, int, str]]
    afforded: int


steps = st.lists(
    st.builds(
        Step,
        st.one_of(st.integers(0, 500 * MS), st.sampled_from((0, 20 * MS, 70 * SECOND, 2**55))),
        st.lists(
            st.tuples(st.one_of(KINDS), offset, offset, st.sampled_from(("RAW_IMU", "WHEELS", "a"))),
            max_size=8,
        ),
        st.sampled_from((-5, 0, 1, 50, 300, 10**9)),
    ),
    min_size=1,
    max_size=15,
)


def numbers_of(value: object) -> list[float]:
    if isinstance(value, float):
        return [value]
    if isinstance(value, dict):
        return [n for part in value.values() for n in numbers_of(part)]
    if isinstance(value, list | tuple):
        return [n for part in value for n in numbers_of(part)]
    return []


def check(estimate: Estimate, estimator: Estimator) -> None:
    figures = numbers_of(msgspec.structs.asdict(estimate))
    assert all(map(math.isfinite, figures)), estimate
    nn, ne, _, ee, _, dd = estimate.position_covariance
    if nn is not None and ne is not None and ee is not None:
        assert nn >= 0.0
        assert ee >= 0.0
        assert ne * ne <= nn * ee * (1 + 1e-6) + 1e-9
        assert estimate.particles <= estimator.configuration.budget.particles_max
    assert dd is None or dd >= 0.0
    assert estimate.heading is None or -math.pi <= estimate.heading <= math.pi
    assert estimate.longitude is None or -180.0 <= estimate.longitude <= 180.0
    assert all(map(math.isfinite, estimator.cloud(50).ravel()))


@settings(max_examples=150, deadline=None)
@given(st.sampled_from(CONFIGURATIONS), steps)
def test_nothing_that_is_said_breaks_it(settings_: Configuration, said: list[Step]) -> None:
    estimator = Estimator(settings_)
    now = START
    for step in said:
        now += step.later
        estimator.ingest(
            Sample(now + received + time, now + received, "l", source, reading)
            for reading, time, received, source in step.arrivals
        )
        check(estimator.tick(now, now, step.afforded), estimator)
    statuses = estimator.sensors(now)
    assert all(map(math.isfinite, numbers_of([msgspec.structs.asdict(s) for s in statuses])))
    assert all(count > 0 for count in estimator.drops.values())
