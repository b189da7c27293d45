"""``kidnap`` and ``late_fix``: the belief is far from the truth, and then consistent evidence comes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from sim_vehicle.chance import stream
from sim_vehicle.faults import Window
from sim_vehicle.scenario import Event, Scenario, SensorFacts
from sim_vehicle.scenarios import beacons, satellites, yard
from sim_vehicle.sensors import Stray, StrayRange

DESCRIPTION = (
    "start told 2 km wrong; then GNSS (even seeds) or 4 beacons (odd seeds); single outliers of 300 m"
)
LATE_DESCRIPTION = "5 min of dead reckoning, then GNSS, with single outliers of 300 m"
FAR = 2000.0
OUTLIER = 300.0
STRAYS = 4
LATE = 300.0


def draw(seed: int) -> Scenario:
    """Return the drive whose start is told wrong, with the evidence drawn from the seed."""
    chance = stream(seed, "scenario kidnap")
    rover = beacons.draw(seed)
    evidence = float(chance.uniform(5.0, 15.0))
    bearing = float(chance.uniform(-math.pi, math.pi))
    honest = yard.told(rover.start, 0.5, 0.1, chance)
    north, east, down = honest.position
    told = (north + FAR * math.cos(bearing), east + FAR * math.sin(bearing), down)
    strays = _times(evidence + 30.0, 115.0, chance)
    rover = replace(
        rover,
        name="kidnap",
        description=DESCRIPTION,
        seconds=120.0,
        belief=replace(honest, position=told),
        events=_events(evidence, strays),
    )
    return (
        _by_satellites(rover, evidence, strays, chance)
        if seed % 2 == 0
        else _by_ranges(rover, evidence, strays)
    )


def draw_late(seed: int) -> Scenario:
    """Return the drive by wheels and gyro alone, whose receiver finds its satellites after five minutes."""
    chance = stream(seed, "scenario late_fix")
    rover = replace(
        beacons.draw(seed),
        name="late_fix",
        description=LATE_DESCRIPTION,
        seconds=LATE + 90.0,
    )
    strays = _times(LATE + 30.0, LATE + 85.0, chance)
    return replace(_by_satellites(rover, LATE, strays, chance), events=_events(LATE, strays))


def _by_satellites(
    rover: Scenario, evidence: float, strays: list[float], chance: np.random.Generator
) -> Scenario:
    bearings = chance.uniform(-math.pi, math.pi, len(strays))
    gnss = replace(
        satellites.receiver(),
        outages=(Window(stop=evidence),),
        interference=tuple(
            Stray(time, (OUTLIER * math.cos(float(bearing)), OUTLIER * math.sin(float(bearing))))
            for time, bearing in zip(strays, bearings, strict=True)
        ),
    )
    return replace(rover, ranger=None, gnss=gnss, facts=satellites.facts())


def _by_ranges(rover: Scenario, evidence: float, strays: list[float]) -> Scenario:
    assert rover.ranger is not None
    cadence = replace(rover.ranger.cadence, phase=evidence)
    ranger = replace(
        rover.ranger, cadence=cadence, strays=tuple(StrayRange(time, OUTLIER) for time in strays)
    )
    return replace(
        rover,
        ranger=ranger,
        facts=(SensorFacts("range", "autopilot", sigma=beacons.RANGE_SIGMA, outliers=0.02),),
    )


def _times(first: float, last: float, chance: np.random.Generator) -> list[float]:
    """Return when the single outliers come, one in each of as many equal parts of the time."""
    part = (last - first) / STRAYS
    begins = [first + index * part for index in range(STRAYS)]
    return [float(chance.uniform(begin, begin + part - 5.0)) for begin in begins]


def _events(evidence: float, strays: list[float]) -> tuple[Event, ...]:
    return (Event(evidence, "evidence"), *(Event(time, "outlier") for time in strays))
