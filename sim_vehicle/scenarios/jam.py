"""``jam``: the satellite receiver goes wild, claims what it likes, and is honest again after a while.

How it goes wild is drawn: fix by fix by hundreds of metres, as a simulated ArduPilot's receiver does; away
steadily; or from one wrong place to the next.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from sim_vehicle.chance import stream
from sim_vehicle.faults import Window
from sim_vehicle.scenario import Event, Scenario
from sim_vehicle.scenarios import beacons, satellites
from sim_vehicle.sensors import Jamming

DESCRIPTION = "wheels, gyro and GNSS that is jammed for 50 s: wild, drifting or jumping, some claiming 0.3 m"
LENGTH = 50.0


def draw(seed: int) -> Scenario:
    """Return the drive with the manner and the time of the jamming drawn from the seed."""
    chance = stream(seed, "scenario jam")
    begin = float(chance.uniform(50.0, 80.0))
    window = Window(begin, begin + LENGTH)
    return replace(
        beacons.draw(seed),
        name="jam",
        description=DESCRIPTION,
        seconds=180.0,
        ranger=None,
        gnss=replace(satellites.receiver(), interference=(_jamming(window, chance),)),
        facts=satellites.facts(),
        events=(Event(window.start, "jam"), Event(window.stop, "honest")),
    )


def _jamming(window: Window, chance: np.random.Generator) -> Jamming:
    bearing = float(chance.uniform(-math.pi, math.pi))
    rate = float(chance.uniform(5.0, 30.0))
    drift = rate * math.cos(bearing), rate * math.sin(bearing)
    silences = tuple(
        Window(start, start + float(chance.uniform(1.0, 6.0)))
        for start in window.start + np.sort(chance.uniform(2.0, LENGTH - 8.0, 2))
    )
    ways = (
        Jamming(window, float(chance.uniform(30.0, 120.0)), (0.0, 0.0), 150.0, 0.0, 20.0, silences=silences),
        Jamming(window, 1.0, drift, 1.0, 0.0, 0.3, bold=1.0, silences=silences),
        Jamming(
            window, 0.5, (0.0, 0.0), 300.0, float(chance.uniform(4.0, 12.0)), 0.3, 0.8, silences=silences
        ),
    )
    return ways[int(chance.integers(len(ways)))]
