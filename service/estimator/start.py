"""The first particles: about a given pose, about the first fix, or anywhere in an area."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from filters.motion.learned import Learned, SlowState
from filters.motion.slow import RandomWalk
from service.config import Configuration, Sensor

Columns = dict[str, NDArray[np.float32]]

UNKNOWN_DOWN = 2.0
"""Metres; how far from the origin's height a vehicle may be of whose height nothing was said."""


class Anchor(NamedTuple):
    """Where a start lies: metres north, east, down and their standard deviations; ``None``: anywhere."""

    position: tuple[float, float, float | None]
    sigma: tuple[float, float, float]


DELAY = "gnss_delay"
"""The slow state of a receiver's delay: one for its positions and its velocities, which come of the same fix."""

SENSOR_WALK = 1e-4
"""Per √s; how fast a sensor's scale or bias wanders."""

DELAY_WALK = 1e-3
"""s per √s; a receiver that is busy answers later."""

POSE = 3
"""Columns that every belief begins with."""

ZERO = (0.0, 0.0)
MARGINALISED = {
    "gyro_bias": ZERO,
    "odometry_scale": (1.0, 0.0),
    "velocity_north": ZERO,
    "velocity_east": ZERO,
    "velocity_down": ZERO,
}
"""Mean and spread of the columns whose own spread at the start the motion model knows."""


def sensor_states(configuration: Configuration) -> list[SlowState]:
    """Return the slow states that the sensors ask for, each once: ranges have one bias for each beacon."""
    sampled = [
        RandomWalk(name, DELAY_WALK if name == DELAY else SENSOR_WALK)
        for name in _sensor_sigmas(configuration)
    ]
    learned = {
        state.name: state for sensor in configuration.sensor for state in _biases(sensor, configuration)
    }
    return [*sampled, *learned.values()]


def beacon_bias(beacon: int) -> str:
    """Return the name of the bias of ranges to a beacon."""
    return f"range_bias/{beacon}"


def biased_beacons(sensor: Sensor, configured: Iterable[int]) -> list[int]:
    """Return the beacons of ``configured`` whose ranges' biases ``sensor`` estimates."""
    if sensor.kind != "range" or "bias" not in sensor.estimate:
        return []
    return [beacon for beacon in configured if sensor.beacons is None or beacon in sensor.beacons]


def _biases(sensor: Sensor, configuration: Configuration) -> list[Learned]:
    configured = [beacon.id for beacon in configuration.beacon]
    beacons = biased_beacons(sensor, configured)
    return [Learned(beacon_bias(beacon), sensor.bias_walk, sensor.bias_sigma) for beacon in beacons]


def _sensor_sigmas(configuration: Configuration) -> dict[str, tuple[float, float]]:
    """Return mean and standard deviation at the start of every slow state of a sensor, by column name."""
    sigmas: dict[str, tuple[float, float]] = {}
    for sensor in configuration.sensor:
        if "scale" in sensor.estimate:
            sigmas.setdefault(f"{sensor.kind}_scale", (1.0, sensor.scale_sigma))
        if "bias" in sensor.estimate and sensor.kind != "range":
            sigmas.setdefault(f"{sensor.kind}_bias", (0.0, sensor.bias_sigma))
        if "delay" in sensor.estimate:
            sigmas.setdefault(DELAY, (0.0, sensor.delay_sigma))
    return sigmas


def draw(
    configuration: Configuration, names: tuple[str, ...], count: int, seed: int, anchor: Anchor | None
) -> Columns:
    """Draw ``count`` particles for the columns ``names``.

    Parameters
    ----------
    anchor : Anchor or None
        About which place; ``None`` draws uniformly over ``[area]``.

    Returns
    -------
    Columns
        One float32 array of shape (count,) per name.
    """
    random = np.random.Generator(np.random.Philox(key=seed))
    columns: Columns = {}
    columns["north"], columns["east"] = _places(configuration, count, random, anchor)
    columns["heading"] = _headings(configuration, count, random)
    sigmas = MARGINALISED | _sensor_sigmas(configuration) | {"down": _down(anchor)}
    for name in names[POSE:]:
        mean, sigma = sigmas.get(name, ZERO)  # a bias that a sensor learns begins at zero
        columns[name] = (mean + sigma * random.standard_normal(count)).astype(np.float32)
    return {name: columns[name] for name in names}


def _places(
    configuration: Configuration, count: int, random: np.random.Generator, anchor: Anchor | None
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    if anchor is None:
        if configuration.area is None:
            raise ValueError('start: mode = "global" needs an [area]')
        north = random.uniform(*configuration.area.north, count)
        east = random.uniform(*configuration.area.east, count)
    else:
        north = anchor.position[0] + anchor.sigma[0] * random.standard_normal(count)
        east = anchor.position[1] + anchor.sigma[1] * random.standard_normal(count)
    return north.astype(np.float32), east.astype(np.float32)


def _down(anchor: Anchor | None) -> tuple[float, float]:
    """Return mean and standard deviation of a height at the start."""
    if anchor is None or anchor.position[2] is None:
        return 0.0, UNKNOWN_DOWN
    return anchor.position[2], anchor.sigma[2]


def _headings(configuration: Configuration, count: int, random: np.random.Generator) -> NDArray[np.float32]:
    if configuration.vehicle.motion == "constant_velocity":
        return np.zeros(count, np.float32)  # a point has none
    heading, sigma = configuration.start.heading, configuration.start.sigma_heading
    if heading is None or sigma is None:
        return random.uniform(-math.pi, math.pi, count).astype(np.float32)
    drawn = heading + sigma * random.standard_normal(count)
    return (np.mod(drawn + math.pi, 2 * math.pi) - math.pi).astype(np.float32)
