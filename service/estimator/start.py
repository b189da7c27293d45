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

RECEIVER_BIAS = "position_bias"
"""What the names of the states of receivers' errors begin with."""

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

BIASES = {"range": (0.2, 0.003), "altitude": (100.0, 0.02), "speed": (0.1, 0.001)}
"""What a bias may be at the start, and its walk per √s, where the configuration does not say, by kind. Of an altitude
it is the weather, which moves a barometer by a metre an hour, and more where a front goes through."""


def sensor_states(configuration: Configuration) -> list[SlowState]:
    """Return the slow states that the sensors ask for, each once: ranges have one bias for each beacon.

    Biases of altitudes are not among them (:func:`altitude_biases`).
    """
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


def slow_state(sensor: Sensor, what: str) -> str:
    """Return the name of a sensor's slow state; ranges share theirs, of all others each sensor has its own."""
    index = None if sensor.index is None else str(sensor.index)
    own = () if sensor.kind == "range" else (sensor.link, sensor.source, index)
    return "/".join([f"{sensor.kind}_{what}", *(part for part in own if part is not None)])


def receiver_name(sensor: Sensor) -> str:
    """Return what the slow states of a receiver's lasting error are named after."""
    return slow_state(sensor, "bias")


def learned_bias(sensor: Sensor, name: str) -> Learned:
    """Return a bias of a sensor under a name, as its settings and its kind have it."""
    sigma, walk = BIASES[sensor.kind]
    return Learned(
        name,
        walk if sensor.bias_walk is None else sensor.bias_walk,
        sigma if sensor.bias_sigma is None else sensor.bias_sigma,
    )


def altitude_biases(configuration: Configuration) -> list[Learned]:
    """Return the biases of altitudes: slow states of whoever has the height."""
    sensors = {
        slow_state(sensor, "bias"): sensor
        for sensor in configuration.sensor
        if sensor.kind == "altitude" and "bias" in sensor.estimate
    }
    return [learned_bias(sensor, name) for name, sensor in sensors.items()]


def _biases(sensor: Sensor, configuration: Configuration) -> list[Learned]:
    if sensor.kind == "speed" and "bias" in sensor.estimate:
        return [learned_bias(sensor, slow_state(sensor, "bias"))]
    configured = [beacon.id for beacon in configuration.beacon]
    beacons = biased_beacons(sensor, configured)
    return [learned_bias(sensor, beacon_bias(beacon)) for beacon in beacons]


def _sensor_sigmas(configuration: Configuration) -> dict[str, tuple[float, float]]:
    """Return mean and standard deviation at the start of every slow state of a sensor, by column name."""
    sigmas: dict[str, tuple[float, float]] = {}
    for sensor in configuration.sensor:
        if "scale" in sensor.estimate:
            sigmas.setdefault(slow_state(sensor, "scale"), (1.0, sensor.scale_sigma))
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
