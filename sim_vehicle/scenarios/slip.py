"""``slip``: the wheels spin by 30 % for 20 s, just as two of the four beacons are silent."""

from __future__ import annotations

from dataclasses import replace

from sim_vehicle.chance import stream
from sim_vehicle.course import Course
from sim_vehicle.faults import Window
from sim_vehicle.scenario import Event, Scenario
from sim_vehicle.scenarios import beacons
from sim_vehicle.sensors import BeaconLoss, Slip

DESCRIPTION = "wheels that slip by 30 % for 20 s while 2 of 4 beacons are lost; 120 s without a stop"
SHARE = 0.3
LENGTH = 20.0


def draw(seed: int) -> Scenario:
    """Return the drive with the time of the slip and the lost beacons drawn from the seed."""
    chance = stream(seed, "scenario slip")
    rover = beacons.draw(seed)
    assert rover.ranger is not None
    assert rover.wheels is not None
    begin = float(chance.uniform(40.0, 70.0))
    window = Window(begin, begin + LENGTH)
    lost = sorted(int(beacon) for beacon in chance.choice(4, 2, replace=False))
    # Whoever stands cannot slip: the stops of the yard are left out.
    driven = Course(tuple(replace(point, pause=0.0) for point in rover.course.waypoints))
    return replace(
        rover,
        name="slip",
        description=DESCRIPTION,
        seconds=120.0,
        course=driven,
        wheels=replace(rover.wheels, slips=(Slip(window, SHARE),)),
        ranger=replace(rover.ranger, losses=tuple(BeaconLoss(beacon, window) for beacon in lost)),
        events=(Event(window.start, "slip"), Event(window.stop, "grip")),
    )
