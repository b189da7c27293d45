"""What a sight of a landmark is worth beside those before it: things seen again and again are not so many witnesses.

A camera's errors last as long as it looks at one thing from about one side: the part of a landmark that is hidden, its
lens, a robot that stands where no landmark is. Sights of one thing are told by the name on it. Where that is not known,
the vehicle's own motion says where what was seen before would be seen now: what is seen there is the same thing, unless
the same picture shows it already. Neither asks the belief, so a belief that is wrong makes no sight new.

Each sight is worth the share of the correlation time that has passed since the one before of the same thing: all of
them together come to one independent sight for each such time, as long as they go on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from drivers.sample import SECOND
from service.config import Sensor
from service.estimator.controls import Controls

LEAST = 1e-3
"""Share of a sight that says again what was said at the same instant."""

NEAR = 4.0
"""Standard deviations within which a sight is of the thing expected there."""

MOST = 64
"""Things that are remembered: the one seen the longest time ago is forgotten."""


@dataclass
class Thing:
    """What was seen, where (metres ahead and to the right of the vehicle, or its direction only), and when."""

    name: int | None
    time: int
    ahead: float
    right: float


class Sightings:
    """The things that one camera has seen lately.

    Parameters
    ----------
    settings : Sensor
        Its ``correlation_s``; without it, or with 0, every sight counts for itself.
    """

    def __init__(self, settings: Sensor) -> None:
        self._correlation = settings.correlation_s or 0.0
        self._things: list[Thing] = []

    def share(self, time: int, name: int | None) -> float:
        """Return what a sight of the thing called ``name`` is worth, of an independent one.

        Parameters
        ----------
        time : int
            Nanoseconds, of the sight.
        """
        if self._correlation == 0.0:
            return 1.0
        known = next((thing for thing in self._things if thing.name == name), None)
        return self._note(known, Thing(name, time, 0.0, 0.0))

    def share_unnamed(
        self, time: int, sight: tuple[float | None, float], sigmas: tuple[float, float], controls: Controls
    ) -> float:
        """Return what a sight of something without a name is worth, of an independent one.

        Parameters
        ----------
        time : int
            Nanoseconds, of the sight.
        sight : (float or None, float)
            Distance (m), if there is one, and direction (rad, clockwise from the nose).
        sigmas : (float, float)
            Standard deviations of both.
        controls : Controls
            How the vehicle moved since the sights before.
        """
        if self._correlation == 0.0:
            return 1.0
        distance, bearing = sight
        length = 1.0 if distance is None else distance
        seen = Thing(None, time, length * math.cos(bearing), length * math.sin(bearing))
        reach = NEAR * max(length * sigmas[1], 0.0 if distance is None else sigmas[0])
        nearest, least = None, reach
        for thing in self._things:
            if thing.time == time:
                continue
            ahead, right = _carried(thing, time, controls, rolls=distance is not None)
            away = math.hypot(ahead - seen.ahead, right - seen.right)
            if away < least:
                nearest, least = thing, away
        return self._note(nearest, seen)

    def _note(self, known: Thing | None, seen: Thing) -> float:
        """Remember what was seen, in the place of what is known of it, and return what it is worth."""
        share = 1.0
        if known is not None:
            self._things.remove(known)
            share = min(1.0, max(LEAST, abs(seen.time - known.time) / SECOND / self._correlation))
        self._things = [
            thing for thing in self._things if seen.time - thing.time < self._correlation * SECOND
        ][1 - MOST :]
        self._things.append(seen)
        return share


def _carried(thing: Thing, time: int, controls: Controls, *, rolls: bool) -> tuple[float, float]:
    """Return where a thing that stands still is seen at ``time``, metres ahead and to the right."""
    distance = controls.distance(thing.time, time).total if rolls else 0.0
    turn = controls.turn(thing.time, time).total
    ahead = thing.ahead - distance * math.cos(0.5 * turn)
    right = thing.right - distance * math.sin(0.5 * turn)
    return (
        ahead * math.cos(turn) + right * math.sin(turn),
        right * math.cos(turn) - ahead * math.sin(turn),
    )
