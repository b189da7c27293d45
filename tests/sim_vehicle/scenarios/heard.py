"""A scenario driven, and what its MAVLink says, decoded by pymavlink."""

from __future__ import annotations

import math
from collections import defaultdict
from typing import Any

from pymavlink.dialects.v20 import all as mavlink

from sim_vehicle.scenario import Scenario
from sim_vehicle.vehicle import Vehicle
from sim_vehicle.world import Truth

METRES_PER_RADIAN = 6_371_000.0


class Heard:
    """A drive's messages by type, its truth fifty times a second, and times since it began."""

    def __init__(self, scenario: Scenario, seed: int, seconds: float) -> None:
        self._scenario = scenario
        self.truth: list[Truth] = []
        self.messages: defaultdict[str, list[Any]] = defaultdict(list)
        vehicle = Vehicle(scenario, seed, 1_700_000_000.0)
        vehicle.watch(50.0, self.truth.append)
        parser = mavlink.MAVLink(None)
        parser.robust_parsing = True
        self.frames = vehicle.advance(seconds)
        for arrival in self.frames.mavlink:
            for message in parser.parse_buffer(arrival.frame) or []:
                self.messages[message.get_type()].append(message)

    def time(self, message: Any) -> float:
        """Return when a message says that it was measured, seconds since the drive began."""
        return message.time_usec / 1e6 - self._scenario.clock.uptime

    def at(self, time: float) -> Truth:
        """Return the truth to the nearest fiftieth of a second."""
        return self.truth[min(len(self.truth) - 1, max(0, round(50.0 * time)))]

    def fixes(self) -> list[tuple[float, float, float]]:
        """Return of every fix its time, and its errors north and east, metres (to the centimetres of 1e-7 degrees)."""
        gnss, origin = self._scenario.gnss, self._scenario.origin
        assert gnss is not None
        errors = []
        for message in self.messages["GPS_RAW_INT"]:
            if message.fix_type < 3:
                continue
            time = self.time(message) - gnss.delay
            truth = self.at(time)
            there = origin.geodetic(truth.north, truth.east, truth.down)
            north = math.radians(1e-7 * message.lat - there[0]) * METRES_PER_RADIAN
            east = math.radians(1e-7 * message.lon - there[1]) * METRES_PER_RADIAN
            errors.append((time, north, east * math.cos(math.radians(there[0]))))
        return errors
