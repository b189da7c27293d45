"""``spoof`` and ``multipath``: a receiver that is led away slowly, and one that only wanders as receivers do."""

from __future__ import annotations

import math
from dataclasses import replace

from sim_vehicle.chance import stream
from sim_vehicle.faults import Window
from sim_vehicle.scenario import Event, Scenario
from sim_vehicle.scenarios import beacons, satellites
from sim_vehicle.sensors import BeaconLoss, Drag

DESCRIPTION = (
    "GNSS dragged off at 0.5 to 2 m/s from 60 to 360 s; odometry (odd seeds: 2 beacons, too) disagrees"
)
MULTIPATH_DESCRIPTION = "10 min of honest GNSS in multipath that wanders by 5 m; --seconds 3600 for an hour"
BEGIN, HONEST = 60.0, 360.0
MULTIPATH = 5.0


def draw(seed: int) -> Scenario:
    """Return the drive with the rate and the direction of the drag drawn from the seed."""
    chance = stream(seed, "scenario spoof")
    drag = Drag(
        Window(BEGIN, HONEST), float(chance.uniform(0.5, 2.0)), float(chance.uniform(-math.pi, math.pi))
    )
    rover = beacons.draw(seed)
    assert rover.ranger is not None
    ranger = replace(rover.ranger, losses=tuple(BeaconLoss(beacon, Window()) for beacon in (0, 2)))
    with_beacons = seed % 2 == 1
    return replace(
        rover,
        name="spoof",
        description=DESCRIPTION,
        seconds=450.0,
        ranger=ranger if with_beacons else None,
        gnss=replace(satellites.receiver(), interference=(drag,)),
        facts=(*satellites.facts(), *(rover.facts if with_beacons else ())),
        events=(Event(BEGIN, "spoof"), Event(HONEST, "honest")),
    )


def draw_multipath(seed: int) -> Scenario:
    """Return the drive whose receiver is honest but for claiming 60 to 100 % of its error, as many do."""
    chance = stream(seed, "scenario multipath")
    gnss = replace(
        satellites.receiver(),
        wander=MULTIPATH,
        wander_correlation=float(chance.uniform(30.0, 90.0)),
        claim=float(chance.uniform(0.6, 1.0)),
    )
    return replace(
        beacons.draw(seed),
        name="multipath",
        description=MULTIPATH_DESCRIPTION,
        seconds=600.0,
        ranger=None,
        gnss=gnss,
        facts=satellites.facts(),
    )
