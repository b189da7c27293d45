"""``mirror``: two beacons cannot tell left from right of the line between them, until the rover turns."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from sim_vehicle.chance import stream
from sim_vehicle.course import Course, CourseDriver, Waypoint
from sim_vehicle.scenario import Event, Scenario, SensorFacts, StartBelief
from sim_vehicle.scenarios import beacons
from sim_vehicle.sensors import BeaconSite
from sim_vehicle.world import Pose, World

DESCRIPTION = "2 beacons, 10 % of the ranges NLOS: 60 s parallel to their baseline, then a turn by 90 degrees"
PARALLEL = 60.0
OUTLIERS = 0.1
SIGMA = 10.0
_BEGUN, _DONE = math.radians(10.0), math.radians(80.0)


def draw(seed: int) -> Scenario:
    """Return the scenario with the baseline, the side of it and the direction of the turn drawn from the seed.

    The start is told as on the baseline, beside where the rover stands, with a sigma that reaches both sides:
    nothing but the turn can tell them apart.
    """
    chance = stream(seed, "scenario mirror")
    rover = beacons.draw(seed)
    assert rover.ranger is not None
    along = float(chance.uniform(-math.pi, math.pi))
    half, aside = float(chance.uniform(24.0, 32.0)), float(chance.uniform(6.0, 12.0))
    aside, turn = (math.copysign(size, float(chance.uniform(-1.0, 1.0))) for size in (aside, 1.0))
    speed = float(chance.uniform(0.65, 0.85))

    def place(forward: float, right: float) -> tuple[float, float]:
        """Return north and east of a point given along the baseline and to the right of it."""
        north = forward * math.cos(along) - right * math.sin(along)
        return north, forward * math.sin(along) + right * math.cos(along)

    length = speed * PARALLEL
    legs = ((0.5 * length, aside), (0.5 * length, aside + 25.0 * turn), (-length, aside + 25.0 * turn))
    back = (-0.5 * length - 10.0, aside)
    course = Course(tuple(Waypoint(*place(*corner), speed=speed) for corner in (*legs, back)))
    start = Pose(*place(-0.5 * length, aside), 0.0, along)
    ends = [place(end * half, 0.0) for end in (-1.0, 1.0)]
    masts = [round(float(height), 2) for height in chance.uniform(1.5, 3.0, 2)]
    sites = tuple(
        BeaconSite(index, round(north, 2), round(east, 2), -masts[index])
        for index, (north, east) in enumerate(ends)
    )
    scenario = replace(
        rover,
        name="mirror",
        description=DESCRIPTION,
        seconds=120.0,
        course=course,
        start=start,
        belief=_told(start, place(-0.5 * length, 0.0), chance),
        ranger=replace(rover.ranger, beacons=sites, outliers=OUTLIERS),
        facts=(SensorFacts("range", "autopilot", sigma=beacons.RANGE_SIGMA, outliers=OUTLIERS),),
    )
    return replace(scenario, events=_turning(scenario))


def _told(start: Pose, beside: tuple[float, float], chance: np.random.Generator) -> StartBelief:
    shift = 0.3 * SIGMA * chance.standard_normal()
    heading = math.remainder(start.heading + 0.1 * float(chance.standard_normal()), math.tau)
    north, east = beside
    return StartBelief(
        position=(
            north + float(shift) * math.cos(start.heading),
            east + float(shift) * math.sin(start.heading),
            0.0,
        ),
        heading=heading,
        sigma=(SIGMA, SIGMA, 0.1),
        sigma_heading=0.1,
    )


def _turning(scenario: Scenario) -> tuple[Event, ...]:
    """Return when the first turn begins and when it is done, from the drive itself."""
    world = World(scenario.rover, CourseDriver(scenario.course), scenario.start)
    begun = done = 0.0
    for count in range(math.ceil(10.0 * scenario.seconds)):
        turned = abs(world.at(0.1 * count).heading - scenario.start.heading)
        if not begun and turned > _BEGUN:
            begun = 0.1 * count
        if turned > _DONE:
            done = 0.1 * count
            break
    return Event(begun, "turn"), Event(done, "turned")
