"""A dry run before the first tick: each kernel, import and page that a tick needs is touched once.

Throw-away estimators of the same configuration, one with few particles and one with many, are fed invented
readings for each sensor that is configured. What the stages cost at the two counts is their shape on this
machine, from which the governor starts. Nothing else of it is kept, and nothing published.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from statistics import median
from typing import NamedTuple

import msgspec

from drivers.maps import landmarks
from drivers.sample import (
    SECOND,
    Altitude,
    AnyReading,
    Bearing,
    Heading,
    LocalPosition,
    Odometer,
    Range,
    RangeBearing,
    Rotation,
    Sample,
    SampleBatch,
    Speed,
    Velocity,
    decode,
    encode,
)
from service.budget import Meters
from service.config import Configuration, Sensor, Start
from service.estimator import Cause, Course, Estimator, Level
from service.estimator.stopwatch import KALMAN, WITNESSES
from service.governor import PER_MEASUREMENT, WHOLE, Rung
from service.tick_costs import Line

PARTICLE_STAGES = ("motion", "sensing", "resampling", "extraction")

MANY = 20_000
"""Particles of the large rehearsal, where the configuration allows so many."""


class Pace(NamedTuple):
    """So many ticks, nanoseconds apart, of which the first do not count."""

    ticks: int
    period: int
    warm: int


STEADY = Pace(30, 20_000_000, 10)
_BRIEF = Pace(12, 100_000_000, 12)
_SPEED = 1.0
_FEW = 4
_LEAST = 1e-11
"""Seconds per particle below which no slope is believed: the fastest kernel needs more for one load."""


def rehearse(configuration: Configuration) -> dict[str, Line]:
    """Run some ticks with few and with many particles, and with none; return the shapes of the stages.

    Each tick has a reading of every sensor. What grows with their number is divided by it: the shapes are those of a
    tick with one measurement. The witnesses hardly notice the count, but now and then one of them begins anew as the
    belief is, which takes its moments.
    """
    few = configuration.budget.particles_min
    many = min(configuration.budget.particles_max, max(MANY, 2 * few))
    cheap, dear = costs(configuration, few), costs(configuration, many)
    shapes = {
        stage: line(few, cheap[stage], many, dear[stage])
        for stage in PARTICLE_STAGES
        if cheap[stage] > 0.0 and dear[stage] > 0.0
    }
    if cheap[WITNESSES] > 0.0 and "extraction" in shapes:
        shapes[WITNESSES] = Line(cheap[WITNESSES], shapes["extraction"].slope)
    measurements = max(1, _measurements(configuration))
    for stage in PER_MEASUREMENT:
        if stage in shapes:
            shapes[stage] = shapes[stage].times(1.0 / measurements)
    return shapes | deputy(configuration)


def _measurements(configuration: Configuration) -> int:
    return sum(len(_readings(sensor, configuration, 0.0)) for sensor in configuration.sensor)


def deputy(configuration: Configuration) -> dict[str, Line]:
    """Return the shape of the Kalman filter that stands in for the particles, over the measurements of a tick."""
    measurements = _measurements(configuration)
    if measurements == 0:
        return {}
    few = configuration.budget.particles_min
    one, all_of_them = (costs(configuration, few, Rung(Level.KALMAN, most)) for most in (1, measurements))
    return {KALMAN: line(1, one[KALMAN], measurements, all_of_them[KALMAN])} if one[KALMAN] > 0.0 else {}


def touch(configuration: Configuration) -> None:
    """Run a few ticks of each kind, so that each kernel, import and page has been used once; nothing is measured."""
    few = configuration.budget.particles_min
    for rung in (WHOLE, Rung(Level.KALMAN, WHOLE.most)):
        costs(configuration, few, rung, _BRIEF)


def line(few: int, cheap: float, many: int, dear: float) -> Line:
    """Return the line through two points, or the nearest that neither falls nor starts below zero."""
    if many == few:
        return Line(0.0, max(dear / many, _LEAST))
    slope = min(max((dear - cheap) / (many - few), _LEAST), dear / many)
    return Line(max(dear - slope * many, 0.0), slope)


def costs(
    configuration: Configuration, count: int, rung: Rung = WHOLE, pace: Pace = STEADY
) -> dict[str, float]:
    """Return the median cost of every stage at ``count`` particles, seconds, over the ticks in which it ran."""
    meters = Meters(pace.ticks)
    start = Start(mode="given", position=(0.0, 0.0, 0.0), heading=0.0, sigma_heading=0.1)
    budget = configuration.budget.model_copy(update={"particles_min": count, "particles_max": count})
    estimator = Estimator(configuration.model_copy(update={"start": start, "budget": budget}), meters)
    encoder = msgspec.json.Encoder()
    seconds: dict[str, list[float]] = {stage: [] for stage in (*PARTICLE_STAGES, WITNESSES, KALMAN)}
    course = Course()
    now = 0
    for tick in range(pace.ticks):
        now = SECOND + tick * pace.period
        meters.begin()
        datagram = decode(encode(SampleBatch(list(_samples(configuration, now)))))
        if isinstance(datagram, SampleBatch):
            estimator.ingest(datagram.samples)
        meters.lap("ingest")
        course.set(rung.level, Cause.NONE, rung.most)
        encoder.encode(estimator.tick(now, now, count, course))
        meters.end(0.0, 0.0)
        for stage, costs in seconds.items():
            if tick >= pace.warm and meters.costs[stage] > 0.0:
                costs.append(meters.costs[stage])
    encoder.encode(estimator.sensors(now))
    estimator.cloud(configuration.publish.particles)
    return {stage: median(costs) if costs else 0.0 for stage, costs in seconds.items()}


def _samples(configuration: Configuration, time: int) -> Iterator[Sample]:
    """Return what a vehicle that drives north at 1 m/s would have said at ``time``."""
    north = _SPEED * time * 1e-9
    default = configuration.link[0].name
    controls: tuple[AnyReading, ...] = (Odometer((north, north)), Rotation(0.0))
    for reading in controls:
        yield Sample(time, time, default, "rehearsal", reading)
    for sensor in configuration.sensor:
        for reading in _readings(sensor, configuration, north):
            yield Sample(time, time, sensor.link or default, sensor.source or "rehearsal", reading)


def _readings(sensor: Sensor, configuration: Configuration, north: float) -> list[AnyReading]:
    if sensor.kind == "range":
        return [Range(beacon.id, 10.0) for beacon in configuration.beacon]
    if sensor.kind == "position":
        return [LocalPosition(north, 0.0, 0.0)]
    if sensor.kind == "velocity":
        return [Velocity(_SPEED, 0.0, 0.0)]
    if sensor.kind == "bearing":
        return [Bearing(0.0, landmark) for landmark in _landmarks(configuration.map.landmarks)]
    if sensor.kind == "range_bearing":
        return [RangeBearing(10.0, 0.0, landmark) for landmark in _landmarks(configuration.map.landmarks)]
    if sensor.kind == "heading":
        return [Heading(0.0)]
    if sensor.kind == "speed":
        return [Speed(_SPEED)]
    if sensor.kind == "altitude":
        return [Altitude(0.0)]
    return []


@cache
def _landmarks(path: str) -> list[int]:
    """Return the numbers of a few landmarks of a map."""
    return list(landmarks.read(Path(path)))[:_FEW] if path else []
