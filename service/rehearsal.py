"""A dry run before the first tick: each kernel, import and page that a tick needs is touched once.

A throw-away estimator of the same configuration is fed one second of invented readings, for each sensor that
is configured, and its estimates are encoded. Nothing of it is published or kept.
"""

from __future__ import annotations

from collections.abc import Iterator

import msgspec

from drivers.sample import (
    AnyReading,
    Heading,
    LocalPosition,
    Odometer,
    Range,
    Rotation,
    Sample,
    Velocity,
    decode,
    encode,
)
from drivers.sample import SampleBatch as Batch
from service.config import Configuration, Sensor, Start
from service.estimator import Estimator

_TICKS = 50
_PERIOD_NS = 20_000_000
_SPEED = 1.0


def rehearse(configuration: Configuration) -> int:
    """Run a second of ticks on a throw-away estimator; return how many particles the last one had."""
    start = Start(mode="given", position=(0.0, 0.0, 0.0), heading=0.0, sigma_heading=0.1)
    estimator = Estimator(configuration.model_copy(update={"start": start}))
    encoder = msgspec.json.Encoder()
    particles = 0
    now = 0
    for tick in range(_TICKS):
        now = 1_000_000_000 + tick * _PERIOD_NS
        datagram = decode(encode(Batch(list(_samples(configuration, now)))))
        if isinstance(datagram, Batch):
            estimator.ingest(datagram.samples)
        estimate = estimator.tick(now, now, configuration.budget.particles_max)
        encoder.encode(estimate)
        particles = estimate.particles
    encoder.encode(estimator.sensors(now))
    estimator.cloud(configuration.publish.particles)
    return particles


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
    if sensor.kind == "heading":
        return [Heading(0.0)]
    return []
