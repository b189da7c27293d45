"""The whole vehicle: one queue of events that measures, streams and delivers, in the order of its own time.

Time is seconds since the drive began. :meth:`Vehicle.advance` runs up to a time and returns the frames that
have arrived by then; whether that time follows a clock or not is the caller's affair, and the bytes are the
same.
"""

from __future__ import annotations

import bisect
import heapq
import importlib
import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from sim_vehicle.autopilot import Autopilot
from sim_vehicle.chance import stream
from sim_vehicle.course import CourseDriver
from sim_vehicle.faults import Faults, Kind
from sim_vehicle.frame import CanFrame
from sim_vehicle.scenario import Scenario
from sim_vehicle.sensors import Barometer, Cadence, Compass, Gnss, Inertial, Ranger, Wheels
from sim_vehicle.telemetry import Knowledge
from sim_vehicle.wire import Arrival, Wire
from sim_vehicle.world import Truth, World


class Sensor(Protocol):
    """What the vehicle asks of a sensor."""

    def measure(self, truth: Truth) -> Any:
        """Return a reading of the truth, or ``None``."""
        ...


def _arrival_time(arrival: Arrival[Any]) -> float:
    return arrival.time


Take = Callable[[Any, float], None]
"""Takes a reading and the time at which it is there."""


@dataclass(slots=True)
class Frames:
    """What has arrived at a listener: MAVLink frames and CAN frames, each in order of arrival."""

    mavlink: list[Arrival[bytes]] = field(default_factory=list[Arrival[bytes]])
    can: list[Arrival[CanFrame]] = field(default_factory=list[Arrival[CanFrame]])


def prepare(scenario: Scenario) -> None:
    """Load what a vehicle of this scenario needs: dronecan takes most of a second, only a bus needs it."""
    if scenario.bus is not None:
        importlib.import_module("sim_vehicle.bus")


class Vehicle:
    """A scenario, driving.

    Parameters
    ----------
    scenario : Scenario
        What it is.
    seed : int
        Of all its random numbers.
    unix : float
        Unix seconds at which the drive begins.
    """

    def __init__(self, scenario: Scenario, seed: int, unix: float) -> None:
        self._scenario = scenario
        self._seed = seed
        self._events: list[tuple[float, int, Callable[[float], None]]] = []
        self._order = itertools.count()
        self._on_the_way = Frames()
        self.world = World(scenario.rover, CourseDriver(scenario.course), scenario.start)
        self.now = 0.0
        self.mavlink = self._wire("mavlink")
        self.can = self._wire("can")
        self.autopilot = self._fit_autopilot(unix)
        self._every(50.0, lambda now: self.autopilot.take_truth(self.world.at(now)))
        if scenario.bus is not None:
            self._fit_bus(unix)

    def advance(self, until: float) -> Frames:
        """Run up to ``until`` and return the frames that arrive until then."""
        while True:
            streaming = self.autopilot.next_due
            measuring = self._events[0][0] if self._events else math.inf
            if min(streaming, measuring) > until:
                break
            if measuring <= streaming:
                self.now, _, action = heapq.heappop(self._events)
                action(self.now)
            else:
                self.now = streaming
                self.autopilot.stream(streaming)
        return self._arrived(until)

    def watch(self, rate: float, take: Callable[[Truth], None]) -> None:
        """Hand the truth over ``rate`` times a second from now on; to be called before the first advance."""
        self._every(rate, lambda now: take(self.world.at(now)))

    @property
    def next_event(self) -> float:
        """When something next happens, seconds since the drive began."""
        waiting = [frames[0].time for frames in (self._on_the_way.mavlink, self._on_the_way.can) if frames]
        return min([self.autopilot.next_due, *(event[0] for event in self._events[:1]), *waiting])

    def _wire(self, name: str) -> Wire:
        scenario = self._scenario
        settings = scenario.mavlink if name == "mavlink" or scenario.bus is None else scenario.bus.wire
        return Wire(settings, self._faults(name), self._chance(f"wire {name}"))

    def _chance(self, name: str) -> np.random.Generator:
        return stream(self._seed, name)

    def _faults(self, target: str) -> Faults:
        return Faults(target, self._scenario.faults, self._chance(f"faults {target}"))

    def _at(self, time: float, action: Callable[[float], None]) -> None:
        heapq.heappush(self._events, (time, next(self._order), action))

    def _every(self, rate: float, action: Callable[[float], None]) -> None:
        due: Iterator[float] = (count / rate for count in itertools.count())

        def act(now: float) -> None:
            action(now)
            self._at(next(due), act)

        self._at(next(due), act)

    def _fit(self, name: str, sensor: Sensor, cadence: Cadence, take: Take, delay: float = 0.0) -> None:
        """Let a sensor measure at its rate and hand each reading over when it is there."""
        chance, faults = self._chance(f"cadence {name}"), self._faults(name)
        due: Iterator[float] = (cadence.due(count) for count in itertools.count())
        last = 0.0

        def measure(now: float) -> None:
            nonlocal last
            self._at(next(due), measure)
            reading, further = sensor.measure(self.world.at(now)), cadence.delay(chance)
            struck = {fault.kind: fault for fault in faults.strike(now)}
            if reading is None or further is None or Kind.DROP in struck:
                return
            if Kind.DELAY in struck:
                further += struck[Kind.DELAY].delay
            last = max(last, now + delay + further)
            self._at(last, lambda time: take(reading, time))

        self._at(next(due), measure)

    def _fit_autopilot(self, unix: float) -> Autopilot:
        scenario, chance = self._scenario, self._chance
        known = Knowledge(scenario.clock, scenario.origin, unix, scenario.track)
        autopilot = Autopilot(known, self._send_mavlink)
        if scenario.wheels:
            wheels = Wheels(scenario.wheels, chance("wheels"))
            self._fit("wheels", wheels, scenario.wheels.cadence, autopilot.take_wheels)
        if scenario.inertial:
            inertial = Inertial(scenario.inertial, chance("inertial"))
            self._fit("inertial", inertial, scenario.inertial.cadence, autopilot.take_inertial)
        if scenario.compass:
            known.declination = scenario.compass.declination
            compass = Compass(scenario.compass, chance("compass"))
            self._fit("compass", compass, scenario.compass.cadence, autopilot.take_compass)
        if scenario.barometer:
            barometer = Barometer(scenario.barometer, scenario.origin.altitude, chance("barometer"))
            self._fit("barometer", barometer, scenario.barometer.cadence, autopilot.take_pressure)
        if scenario.ranger:
            known.range_sigma = scenario.ranger.sigma
            ranger = Ranger(scenario.ranger, chance("beacons"))
            self._fit("beacons", ranger, scenario.ranger.cadence, autopilot.take_beacon)
        if scenario.gnss:
            gnss = Gnss(scenario.gnss, chance("gnss"))
            self._fit("gnss", gnss, scenario.gnss.cadence, autopilot.take_gnss, scenario.gnss.delay)
        return autopilot

    def _fit_bus(self, unix: float) -> None:
        scenario, chance, settings = self._scenario, self._chance, self._scenario.bus
        if settings is None:
            return
        # Here and not above, for the reason that prepare gives.
        from sim_vehicle.bus import Bus

        bus = Bus(settings, scenario.origin, unix, self._send_can)
        if settings.gnss:
            gnss = Gnss(settings.gnss, chance("bus gnss"))
            self._fit("bus gnss", gnss, settings.gnss.cadence, bus.take_gnss, settings.gnss.delay)
        if settings.inertial:
            inertial = Inertial(settings.inertial, chance("bus inertial"))
            self._fit("bus inertial", inertial, settings.inertial.cadence, bus.take_inertial)
        if settings.compass:
            compass = Compass(settings.compass, chance("bus compass"))
            self._fit("bus compass", compass, settings.compass.cadence, bus.take_compass)
        if settings.barometer:
            barometer = Barometer(settings.barometer, scenario.origin.altitude, chance("bus barometer"))
            self._fit("bus barometer", barometer, settings.barometer.cadence, bus.take_pressure)
        if settings.clearance_rate:
            self._every(settings.clearance_rate, bus.clearance)
        if settings.motor_rate:
            self._every(
                settings.motor_rate,
                lambda now: bus.motors(now, self.world.at(now), scenario.rover, scenario.track),
            )
        self._every(1.0, bus.status)

    def _send_mavlink(self, time: float, frame: bytes) -> None:
        for arrival in self.mavlink.carry(time, frame):
            bisect.insort(self._on_the_way.mavlink, arrival, key=_arrival_time)

    def _send_can(self, time: float, frame: CanFrame) -> None:
        for arrival in self.can.carry(time, frame.data):
            spoilt = CanFrame(frame.identifier, arrival.frame, frame.extended)
            bisect.insort(self._on_the_way.can, Arrival(arrival.time, spoilt), key=_arrival_time)

    def _arrived(self, until: float) -> Frames:
        way = self._on_the_way
        mavlink = sum(1 for _ in itertools.takewhile(lambda arrival: arrival.time <= until, way.mavlink))
        can = sum(1 for _ in itertools.takewhile(lambda arrival: arrival.time <= until, way.can))
        arrived = Frames(way.mavlink[:mavlink], way.can[:can])
        del way.mavlink[:mavlink], way.can[:can]
        return arrived
