"""What a subscriber knows of a vehicle: the last of everything that arrived, and the track so far."""

from __future__ import annotations

import time
from collections import deque
from typing import cast

import msgspec

from service.estimate import Budget, Estimate, Health, LinkStatus, Sensors
from service.publish.topics import BUDGET, ESTIMATE, HEALTH, SENSORS, SLOW
from service.view.plot import Point

_TRACK = 1500
_TRACK_STEP = 0.1
_RATE_WINDOW = 5.0


class Known:
    """The last of everything that a vehicle published.

    Attributes
    ----------
    vehicle : str
        Whose.
    estimate, budget, sensors, health
        The last values, or ``None``.
    track : deque[Point]
        Where it thought to be, north and east, at least 0.1 m apart.
    beacons : dict[int, Point]
        Where beacons stand, by their number.
    truth : Point or None
        Where it really is, in a simulation.
    malformed : int
        Values that were not understood.
    """

    def __init__(self, vehicle: str) -> None:
        self.vehicle = vehicle
        self.estimate: Estimate | None = None
        self.budget: Budget | None = None
        self.sensors: Sensors | None = None
        self.health: Health | None = None
        self.track: deque[Point] = deque(maxlen=_TRACK)
        self.beacons: dict[int, Point] = {}
        self.truth: Point | None = None
        self.malformed = 0
        self._arrived: float | None = None
        self._stamps: deque[float] = deque(maxlen=5000)
        self._earlier_links: dict[str, LinkStatus] = {}
        self._earlier_time = 0.0

    def take(self, topic: str, payload: bytes) -> None:
        """Take one value as it came; what is not understood is counted."""
        try:
            if topic in (ESTIMATE.key, SLOW.key):
                self._estimated(msgspec.json.decode(payload, type=Estimate))
            elif topic == BUDGET.key:
                self.budget = msgspec.json.decode(payload, type=Budget)
            elif topic == SENSORS.key:
                self._sensed(msgspec.json.decode(payload, type=Sensors))
            elif topic == HEALTH.key:
                self.health = msgspec.json.decode(payload, type=Health)
        except msgspec.MsgspecError:
            self.malformed += 1

    def configured(self, payload: bytes) -> None:
        """Take the configuration as ``@rpc/config`` answers it: where the beacons are."""
        beacons = cast("list[dict[str, object]]", msgspec.json.decode(payload).get("beacon", []))
        for beacon in beacons:
            position = cast("list[float] | None", beacon.get("position"))
            if position is not None:
                self.beacons[cast("int", beacon["id"])] = (position[0], position[1])

    @property
    def position(self) -> Point | None:
        """Where it thinks it is, north and east."""
        if self.estimate is None:
            return None
        north, east, _ = self.estimate.position
        return None if north is None or east is None else (north, east)

    def rate(self) -> float:
        """Return estimates per second, of those that arrived over the last five seconds of their time."""
        lately = [stamp for stamp in self._stamps if self._stamps[-1] - stamp <= _RATE_WINDOW]
        return (len(lately) - 1) / (lately[-1] - lately[0]) if len(lately) > 1 else 0.0

    def silence(self) -> float | None:
        """Return the seconds since the last estimate arrived; ``None`` when none ever did."""
        return None if self._arrived is None else time.monotonic() - self._arrived

    def message_rate(self, link: LinkStatus) -> float | None:
        """Return a link's messages a second, between the last two values of ``sensors``."""
        earlier = self._earlier_links.get(link.name)
        if earlier is None or self.sensors is None or link.messages < earlier.messages:
            return None
        elapsed = self.sensors.time - self._earlier_time
        return (link.messages - earlier.messages) / elapsed if elapsed > 0 else None

    def _estimated(self, estimate: Estimate) -> None:
        self.estimate = estimate
        self._arrived = time.monotonic()
        if not self._stamps or estimate.time > self._stamps[-1]:  # the slow one is the same once more
            self._stamps.append(estimate.time)
        here = self.position
        if here is not None and (not self.track or _apart(here, self.track[-1]) >= _TRACK_STEP):
            self.track.append(here)

    def _sensed(self, sensors: Sensors) -> None:
        if self.sensors is not None:
            self._earlier_links = {link.name: link for link in self.sensors.links}
            self._earlier_time = self.sensors.time
        self.sensors = sensors


def _apart(a: Point, b: Point) -> float:
    return max(abs(a[0] - b[0]), abs(a[1] - b[1]))
