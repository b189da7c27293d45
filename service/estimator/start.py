"""The first particles: about a given pose, about the first fix, or anywhere in an area."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from service.config import Configuration

Columns = dict[str, NDArray[np.float32]]


class Anchor(NamedTuple):
    """Where a start lies: metres north, east, down and their standard deviations; ``None``: anywhere."""

    position: tuple[float, float, float | None]
    sigma: tuple[float, float, float]


def slow_sigmas(configuration: Configuration) -> dict[str, tuple[float, float]]:
    """Return mean and standard deviation at the start of every slow state, by column name."""
    sigmas = {"gyro_bias": (0.0, 0.0), "odometry_scale": (1.0, 0.0)}  # marginalised: the motion model knows
    for sensor in configuration.sensor:
        if "scale" in sensor.estimate:
            sigmas[f"{sensor.kind}_scale"] = (1.0, sensor.scale_sigma)
        if "bias" in sensor.estimate:
            sigmas[f"{sensor.kind}_bias"] = (0.0, sensor.bias_sigma)
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
    for name, (mean, sigma) in slow_sigmas(configuration).items():
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


def _headings(configuration: Configuration, count: int, random: np.random.Generator) -> NDArray[np.float32]:
    heading, sigma = configuration.start.heading, configuration.start.sigma_heading
    if heading is None or sigma is None:
        return random.uniform(-math.pi, math.pi, count).astype(np.float32)
    drawn = heading + sigma * random.standard_normal(count)
    return (np.mod(drawn + math.pi, 2 * math.pi) - math.pi).astype(np.float32)
