"""The course of one tick: how far it may go, how far it went, and in which words that is told.

The loop decides it before the tick (:mod:`service.governor`), a replay takes it from a recorded one
(:mod:`service.decisions`). What the estimator adds is only what it left out, so that the same course over the same
samples gives the same estimates, whatever machine it is on.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum

CROWD = 64
"""Most measurements that are weighed in one tick, whatever the budget says."""


class Level(IntEnum):
    """How far a tick is degraded, in the declared order."""

    FULL = 0
    FEWER_PARTICLES = 1
    THINNED = 2
    NO_CLOUD = 3
    KALMAN = 4
    PREDICTION_ONLY = 5


class Cause(IntEnum):
    """What a degraded tick had too little of."""

    NONE = 0
    BUDGET = 1
    PROCESSOR = 2


def within_budget() -> bool:
    """Never call for a cut: where nobody measures time."""
    return False


class Course:
    """What a tick may do, and what it did of it. One object serves all ticks: nothing is allocated in between.

    Attributes
    ----------
    level : Level
        As decided before the tick.
    cause : Cause
        Why, if it is not ``FULL``.
    most : int
        Measurements that may be weighed: evenly spaced ones of more than that; 0 with ``PREDICTION_ONLY``.
    overrunning : Callable[[], bool]
        Asked before each measurement but the first: whether the rest of them would make the tick overrun.
    offered, weighed : int
        Measurements that were due in the tick, and those of them that were looked at.
    cut : bool
        Whether ``overrunning`` ended the weighing.
    rested : int
        Ticks left out before this one, to pay for dear ones.
    deputised : bool
        Whether the Kalman filter spoke for the particles, as ``KALMAN`` wants it; it cannot begin at a belief that is
        no Gaussian, and the tick is one of prediction then.
    """

    __slots__ = ("cause", "cut", "deputised", "level", "most", "offered", "overrunning", "rested", "weighed")

    def __init__(
        self,
        level: Level = Level.FULL,
        cause: Cause = Cause.NONE,
        most: int = CROWD,
        overrunning: Callable[[], bool] = within_budget,
    ) -> None:
        self.overrunning = overrunning
        self.rested = 0
        self.set(level, cause, most)

    def set(self, level: Level, cause: Cause, most: int) -> None:
        """Begin another tick."""
        self.level = level
        self.cause = cause
        self.most = most
        self.offered = 0
        self.weighed = 0
        self.cut = False
        self.deputised = False

    @property
    def only_predicts(self) -> bool:
        """Whether every measurement is to be left out."""
        return self.level is Level.PREDICTION_ONLY or (self.level is Level.KALMAN and not self.deputised)

    def goes_on(self) -> bool:
        """Ask for one more measurement; the first is always granted, for a belief lives by them."""
        if self.cut or (self.weighed and self.overrunning()):
            self.cut = True
            return False
        self.weighed += 1
        return True

    def reached(self, demanded: int, afforded: int) -> Level:
        """Return the level of the tick: as decided, or what fewer particles and left out measurements make of it."""
        if self.only_predicts:
            return Level.PREDICTION_ONLY
        if self.weighed < self.offered:
            return max(self.level, Level.THINNED)
        return max(self.level, Level.FEWER_PARTICLES) if afforded < demanded else self.level

    def reason(self, demanded: int, afforded: int) -> str:
        """Return why the tick's level is what it is: what was given up, and for what; empty at ``FULL``."""
        given_up = ", ".join(self._given_up(demanded, afforded))
        if self.cause is Cause.PROCESSOR:
            return f"{given_up}: others use the processor"
        return given_up

    def _given_up(self, demanded: int, afforded: int) -> list[str]:
        said: list[str] = []
        if afforded < demanded:
            said.append(f"{demanded} particles needed, {afforded} afforded")
        if self.deputised:
            said.append("a Kalman filter speaks")
        if self.only_predicts:
            said.append(f"only predicted, {self.offered} measurements dropped")
        elif self.weighed < self.offered:
            how = "cut after" if self.cut else "thinned to"
            said.append(f"{how} {self.weighed} of {self.offered} measurements")
        if self.level is Level.NO_CLOUD:
            said.append("no cloud")
        if self.rested:
            said.append(f"{self.rested} ticks rested")
        return said
