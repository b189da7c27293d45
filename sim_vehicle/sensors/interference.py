"""What strikes a satellite receiver from outside: a spoofer's drag, jamming, a stray fix.

Each is data; :meth:`engage` gives it the random numbers of one drive. What it does to a fix is an
:class:`Effect`, which the receiver adds to what it would have said.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sim_vehicle.faults import Window

Plane = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Effect:
    """What becomes of one fix.

    Attributes
    ----------
    offset, velocity : Plane
        Added to position (m) and velocity (m/s), north and east.
    claim : float or None
        The horizontal accuracy that is claimed instead, metres; ``None``: the receiver's own.
    silent : bool
        No fix at all.
    """

    offset: Plane = (0.0, 0.0)
    velocity: Plane = (0.0, 0.0)
    claim: float | None = None
    silent: bool = False


NOTHING = Effect()


class Disturber(Protocol):
    """An interference at work on one receiver."""

    def at(self, time: float) -> Effect:
        """Return what happens to the fix of this time; asked once a fix, in order of time."""
        ...


class Interference(Protocol):
    """An interference as data."""

    def engage(self, chance: np.random.Generator) -> Disturber:
        """Return it at work, with random numbers of its own."""
        ...


@dataclass(frozen=True, slots=True)
class Drag:
    """A spoofer that leads the receiver away slowly; its fixes agree with each other and claim as ever.

    Attributes
    ----------
    window : Window
        When; at its end the receiver is back at the truth at once.
    rate, bearing : float
        How fast the position leaves the truth, m/s, and where to, radians from north.
    """

    window: Window
    rate: float
    bearing: float

    def engage(self, chance: np.random.Generator) -> Disturber:
        """Return itself: nothing in it is left to chance."""
        return self

    def at(self, time: float) -> Effect:
        """Return how far it has led the fix away."""
        if not self.window.holds(time):
            return NOTHING
        north, east = math.cos(self.bearing), math.sin(self.bearing)
        far = self.rate * (time - self.window.start)
        return Effect((far * north, far * east), (self.rate * north, self.rate * east))


@dataclass(frozen=True, slots=True)
class Stray:
    """One single fix far off: the first one at or after ``time``, by ``offset`` metres north and east."""

    time: float
    offset: Plane

    def engage(self, chance: np.random.Generator) -> Disturber:
        """Return it, not yet happened."""
        return _Straying(self)


class _Straying:
    def __init__(self, stray: Stray) -> None:
        self._stray = stray
        self._happened = False

    def at(self, time: float) -> Effect:
        if self._happened or time < self._stray.time:
            return NOTHING
        self._happened = True
        return Effect(self._stray.offset)


@dataclass(frozen=True, slots=True)
class Jamming:
    """A receiver that is jammed and goes on talking: it strays, jumps, and claims what it likes.

    Attributes
    ----------
    window : Window
        When; before and after, the receiver is honest.
    walk : float
        Random walk of its position, m per root second and axis.
    drift : Plane
        Steady motion of its position, m/s north and east.
    jump, hold : float
        Standard deviation per axis of a further error that is drawn anew every ``hold`` seconds, metres; a hold
        of 0: at every fix.
    speed : float
        Standard deviation of the velocity's error per axis, m/s.
    bold, claim : float
        Share of the fixes that claim ``claim`` metres all the same; the others claim anything up to ``modest``.
    silences : tuple[Window, ...]
        When it has no fix at all.
    """

    window: Window
    walk: float
    drift: Plane
    jump: float
    hold: float
    speed: float
    bold: float = 0.5
    claim: float = 0.3
    modest: float = 300.0
    silences: tuple[Window, ...] = ()

    def engage(self, chance: np.random.Generator) -> Disturber:
        """Return it, with the receiver still at the truth."""
        return _Jammed(self, chance)


class _Jammed:
    def __init__(self, jamming: Jamming, chance: np.random.Generator) -> None:
        self._jamming = jamming
        self._chance = chance
        self._time = jamming.window.start
        self._strayed = np.zeros(2)
        self._jumped = np.zeros(2)
        self._jumps_at = jamming.window.start

    def at(self, time: float) -> Effect:
        jamming, chance = self._jamming, self._chance
        if not jamming.window.holds(time):
            return NOTHING
        elapsed, self._time = time - self._time, time
        steps = chance.standard_normal(2)
        self._strayed += jamming.walk * math.sqrt(elapsed) * steps + elapsed * np.array(jamming.drift)
        if time >= self._jumps_at:
            self._jumped = jamming.jump * chance.standard_normal(2)
            self._jumps_at = time + jamming.hold
        away = self._strayed + self._jumped
        velocity = np.array(jamming.drift) + jamming.speed * chance.standard_normal(2)
        boldly, modestly = float(chance.random()), float(chance.uniform(jamming.claim, jamming.modest))
        return Effect(
            (float(away[0]), float(away[1])),
            (float(velocity[0]), float(velocity[1])),
            jamming.claim if boldly < jamming.bold else modestly,
            any(window.holds(time) for window in jamming.silences),
        )
