"""What is asked of a drive whose sensors lie, slip or fall silent: noticed in time, survived, forgiven in time."""

from __future__ import annotations

import math

import numpy as np

from service.checks.check import Check, at_least, at_most, between, figure
from service.checks.story import Story
from service.estimate import HealthState

GNSS = "position"
"""How the names of receivers among the sensors begin."""


def spoof(story: Story) -> list[Check]:
    """Ask whether the drag was noticed before it mattered, and the return believed in time, not too soon."""
    begin, honest = story.first("spoof"), story.first("honest")
    flagged = story.flagged(GNSS, begin, honest)
    error = story.worst(begin, flagged) if math.isfinite(flagged) else math.nan
    return [
        at_most("no flag before", _flags(story, -math.inf, begin), 0),
        at_most("flagged before 30 m of error", error, 30.0),
        at_most("at most 50 m off in 5 min", story.worst(begin, honest), 50.0),
        at_least("trusted again 10 s after the honest return or later", _waited(story, honest), 10.0),
        at_most("trusted again before the end", _waited(story, honest), float(story.time[-1]) - honest),
        at_most("within 5 m at the end", story.worst(float(story.time[-1]) - 1.0), 5.0),
    ]


def multipath(story: Story) -> list[Check]:
    """Ask that an honest receiver is left in peace."""
    return [
        at_most("no flag", _flags(story, -math.inf, math.inf), 0),
        at_most("never lost, s", _seconds(story, HealthState.LOST), 0.0),
        at_most("at most 20 m off", story.worst(float(story.time[0]) + 5.0), 20.0),
    ]


def jam(story: Story) -> list[Check]:
    """Ask whether a wild receiver was thrown out at once and taken back soon."""
    begin, honest = story.first("jam"), story.first("honest")
    return [
        at_most("no flag before", _flags(story, -math.inf, begin), 0),
        at_most("flagged within 3 s", story.flagged(GNSS, begin, honest) - begin, 3.0),
        at_most("never more than 4 m off", story.worst(begin), 4.0),
        between("trusted again within 15 s", _waited(story, honest), 0.0, 15.0),
    ]


def slip(story: Story) -> list[Check]:
    """Ask whether slipping wheels were reported and survived."""
    begin, grip = story.first("slip"), story.first("grip")
    reported = story.time[story.slipping & story.within(begin, grip)]
    whole = story.score(float(story.time[0]) + 5.0)
    return [
        at_most("slip reported within 2 s", float(reported[0]) - begin if reported.size else math.nan, 2.0),
        at_most("RMSE at most 1 m", figure(story.score(begin).rmse_m), 1.0),
        at_most("at most 2 m off", story.worst(begin), 2.0),
        between(
            "NEES in its 95 % bounds",
            figure(whole.nees_mean),
            figure(whole.nees_low),
            figure(whole.nees_high),
        ),
        at_most("no sensor flagged", _flags(story, -math.inf, math.inf), 0),
    ]


def outage(story: Story) -> list[Check]:
    """Ask whether the belief outlives every trouble of its links, and comes back by itself."""
    known = np.isfinite(story.track.north)
    started = int(np.argmax(known)) if known.any() else len(known)
    again = [_recovered(story, time) for time in story.every("calm")]
    return [
        at_most("ticks without a position", float(np.count_nonzero(~known[started:])), 0),
        at_most("at most 3 m off", story.worst(float(story.time[0]) + 5.0), 3.0),
        at_most("tracking again within 5 s", max(again, default=math.nan), 5.0),
        at_most("no sensor flagged", _flags(story, -math.inf, math.inf), 0),
    ]


def beacons(story: Story) -> list[Check]:
    """Ask for the accuracy of an undisturbed drive, and for no false alarm."""
    score = story.score()
    return [
        at_most("RMSE at most 0.30 m", figure(score.rmse_m), 0.30),
        between("93 to 99 % inside 95 %", figure(score.coverage_95), 0.93, 0.99),
        at_most("no sensor flagged", _flags(story, -math.inf, math.inf), 0),
        at_most("never lost, s", _seconds(story, HealthState.LOST), 0.0),
        at_most("no step of reset_counter", float(story.resets[-1] - story.resets[0]), 0),
    ]


def _flags(story: Story, begin: float, end: float) -> float:
    return float(sum(begin <= flag.begin < end for flag in story.flags))


def _waited(story: Story, honest: float) -> float:
    """Return how long after the honest return a receiver that was flagged then was trusted again; NaN: it was not."""
    return story.trusted(GNSS, honest) - honest


def _seconds(story: Story, state: HealthState) -> float:
    interval = float(np.median(np.diff(story.time)))
    return float(np.count_nonzero(story.health == state.value)) * interval


def _recovered(story: Story, calm: float) -> float:
    """Return how long after a trouble it still was not tracking, s, up to the next one."""
    troubles = [event.time for event in story.events if event.name != "calm" and event.time > calm]
    chosen = story.within(calm, min(troubles, default=math.inf)) & (
        story.health != HealthState.TRACKING.value
    )
    times = story.time[chosen]
    return float(times[-1]) - calm if times.size else 0.0
