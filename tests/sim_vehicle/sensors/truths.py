"""Truths to observe: a straight drive and a circle, without a world."""

from __future__ import annotations

import math

from sim_vehicle.rover import Command
from sim_vehicle.world import Truth


def straight(time: float, speed: float = 1.5, heading: float = 0.0) -> Truth:
    """Return the truth of a drive from the origin along a heading."""
    way = speed * time
    return Truth(
        time,
        way * math.cos(heading),
        way * math.sin(heading),
        0.0,
        heading,
        speed,
        0.0,
        0.0,
        way,
        way,
        Command(speed),
    )


def turning(time: float, speed: float = 1.0, yaw_rate: float = 0.4) -> Truth:
    """Return the truth of a circle."""
    return Truth(
        time, 0.0, 0.0, 0.0, yaw_rate * time, speed, yaw_rate, 0.3, 0.0, 0.0, Command(speed, yaw_rate)
    )
