"""The yard that rovers drive in: 60 m by 60 m, a beacon in each corner, a course drawn at random."""

from __future__ import annotations

import math

import numpy as np

from sim_vehicle.course import Course, Waypoint
from sim_vehicle.geodesy import Origin
from sim_vehicle.scenario import StartBelief
from sim_vehicle.sensors import BeaconSite
from sim_vehicle.world import Pose

ORIGIN = Origin(latitude=51.0543, longitude=3.7174, altitude=12.0)
HALF = 30.0
_MARGIN = 5.0
_SHORTEST, _LONGEST = 14.0, 32.0


def corner_beacons(chance: np.random.Generator) -> tuple[BeaconSite, ...]:
    """Return a beacon near each corner, on masts of 1.5 to 3 m, numbered from 0."""
    corners = ((HALF, -HALF), (HALF, HALF), (-HALF, HALF), (-HALF, -HALF))
    sites: list[BeaconSite] = []
    for index, (north, east) in enumerate(corners):
        shift = chance.uniform(-3.0, 3.0, 2)
        height = float(chance.uniform(1.5, 3.0))
        sites.append(
            BeaconSite(
                index, round(north + float(shift[0]), 2), round(east + float(shift[1]), 2), -round(height, 2)
            )
        )
    return tuple(sites)


def course(chance: np.random.Generator, count: int = 40) -> tuple[Course, Pose]:
    """Return a course through the yard and the pose at its beginning, on the first leg and facing along it.

    Legs are 14 to 32 m long at 1.2 to 2.2 m/s; at about every fifth waypoint the rover stands for 3 to 8 s.
    """
    here = chance.uniform(-HALF + _MARGIN, HALF - _MARGIN, 2)
    start = here
    points: list[Waypoint] = []
    while len(points) < count:
        there = chance.uniform(-HALF + _MARGIN, HALF - _MARGIN, 2)
        if not _SHORTEST <= float(np.hypot(*(there - here))) <= _LONGEST:
            continue
        pause = float(chance.uniform(3.0, 8.0)) if chance.random() < 0.2 else 0.0
        points.append(Waypoint(float(there[0]), float(there[1]), float(chance.uniform(1.2, 2.2)), pause))
        here = there
    first = points[0]
    heading = math.atan2(first.east - float(start[1]), first.north - float(start[0]))
    points.append(Waypoint(float(start[0]), float(start[1])))
    return Course(tuple(points)), Pose(float(start[0]), float(start[1]), 0.0, heading)


def told(start: Pose, sigma: float, sigma_heading: float, chance: np.random.Generator) -> StartBelief:
    """Return what is said about the start: off by errors drawn from the very sigmas that are said with it."""
    north, east, turn = chance.standard_normal(3)
    return StartBelief(
        position=(start.north + sigma * float(north), start.east + sigma * float(east), start.down),
        heading=math.remainder(start.heading + sigma_heading * float(turn), math.tau),
        sigma=(sigma, sigma, 0.1),
        sigma_heading=sigma_heading,
    )
