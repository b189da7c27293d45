"""When and where the belief begins: at a given pose, anywhere in an area, or at the first position fix."""

from __future__ import annotations

from typing import NamedTuple

from drivers.sample import SECOND, GeodeticPosition, LocalPosition
from service.config import Configuration
from service.estimator.binding import position_of
from service.estimator.controls import Controls
from service.estimator.intake import Intake, Passed, Waiting
from service.estimator.start import Anchor
from service.geodesy import Geodetic

STALE = 5 * SECOND
"""How far behind the horizon a starting measurement may lie: a slow computer is late, a minute in a queue is stale."""


class Beginning(NamedTuple):
    """When the belief begins (nanoseconds), about which place (``None``: anywhere), and what is measured after it."""

    time: int
    anchor: Anchor | None
    rest: Passed


class Starter:
    """Waits for what a belief can begin from.

    Parameters
    ----------
    configuration : Configuration
        Its ``[start]``.
    intake : Intake
        Counts what came before the beginning, and learns the origin from a first fix.
    controls : Controls
        Whose first word is a beginning, too.
    """

    def __init__(self, configuration: Configuration, intake: Intake, controls: Controls) -> None:
        self._start = configuration.start
        self._intake = intake
        self._controls = controls

    def attempt(self, horizon: int, passed: Passed) -> Beginning | None:
        """Return the beginning, if what is needed for it has come by the time the horizon passed ``passed``."""
        passed = self._fresh(horizon, passed)
        if self._start.mode == "first_fix":
            return self._at_fix(passed)
        first = min((time for time, _ in passed), default=horizon)
        control = self._controls.earliest
        if not passed and (control is None or control > horizon):
            return None
        time = first if control is None else min(first, max(control, horizon - SECOND))
        place = self._start.position
        return Beginning(time, None if place is None else Anchor(place, self._start.sigma), passed)

    def _fresh(self, horizon: int, passed: Passed) -> Passed:
        """Refuse what is older than a start may lie back: it waited in a queue while nobody ran."""
        fresh = [(time, waiting) for time, waiting in passed if time >= horizon - STALE]
        self._intake.leave_out(passed[: len(passed) - len(fresh)], "late")
        return fresh

    def _at_fix(self, passed: Passed) -> Beginning | None:
        for index, (time, waiting) in enumerate(passed):
            anchor = self._anchor_of(waiting)
            if anchor is not None:
                return Beginning(time, anchor, passed[index + 1 :])
            self._intake.refuse(waiting, "before_start")
        return None

    def _anchor_of(self, waiting: Waiting) -> Anchor | None:
        """Return where a position fix says to start, with the origin learned from it if there was none."""
        reading = waiting.sample.reading
        if not isinstance(reading, GeodeticPosition | LocalPosition):
            return None
        if isinstance(reading, GeodeticPosition):
            altitude = 0.0 if reading.altitude is None else reading.altitude
            self._intake.learn_origin(Geodetic(reading.latitude, reading.longitude, altitude))
        fix = position_of(reading, self._intake.frame)
        if fix is None:
            return None
        sigma = waiting.sensor.sigma(reading.sigma_horizontal)
        return Anchor(fix, (sigma, sigma, reading.sigma_vertical or 2 * sigma))
