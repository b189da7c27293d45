"""What is asked of ``mirror`` and ``kidnap``: several places while nobody can tell, and the right one soon after."""

from __future__ import annotations

import math

import numpy as np

from service.checks.check import Check, at_least, at_most, between, figure, known
from service.checks.story import Story
from service.estimate import HealthState

BEFORE_TURN = 20.0
"""Seconds before the turn in which a mirror image must be known to be one."""

PATIENCE = 5.0
"""Seconds after the turn."""

RIGHT = 5.0
"""Metres of error below which a belief that had been far away is right."""

FOUND = 10.0
"""Seconds of consistent evidence after which it must be."""

MOVED = 5.0
"""Metres by which one outlier must not move the estimate; within :data:`WATCHED` seconds after it."""

WATCHED = 5.0


def share(story: Story, begin: float, end: float, holds: np.ndarray) -> float:
    """Return in which share of the ticks of a stretch something holds."""
    chosen = story.within(begin, end)
    return float(np.mean(holds[chosen])) if chosen.any() else math.nan


def mirror(story: Story) -> list[Check]:
    """Ask whether both images were published, and the right one found."""
    turn, settled = story.first("turn"), story.first("turned") + PATIENCE
    several = story.hypotheses >= 2
    ambiguous = story.health == HealthState.AMBIGUOUS.value
    end = float(story.time[-1])
    return [
        at_least(
            "2 hypotheses in 90 % of 20 s before the turn",
            share(story, turn - BEFORE_TURN, turn, several),
            0.9,
        ),
        at_least(
            "ambiguous in 90 % of 20 s before the turn",
            share(story, turn - BEFORE_TURN, turn, ambiguous),
            0.9,
        ),
        at_least(
            "1 hypothesis from 5 s after the turn", share(story, settled, end, story.hypotheses == 1), 0.95
        ),
        at_most("the right one, within 3 m", story.worst(settled), 3.0),
        at_most("RMSE from then on at most 1 m", figure(story.score(settled).rmse_m), 1.0),
    ]


def kidnap(story: Story) -> list[Check]:
    """Ask whether the belief went to the evidence, once, and not to the outliers."""
    return [*_found(story), _resets(story, least=1), _unmoved(story)]


def late_fix(story: Story) -> list[Check]:
    """Ask the same of a belief that may have kept close enough not to have to jump."""
    evidence = story.first("evidence")
    off = story.worst(evidence - 1.0, evidence)
    covered = story.score(-math.inf, evidence).coverage_95
    return [
        at_least("inside 95 % for 90 % of the dead reckoning", figure(covered), 0.9),
        *_found(story),
        _resets(story, least=1 if off > RIGHT else 0),
        _unmoved(story),
    ]


def _found(story: Story) -> list[Check]:
    evidence = story.first("evidence")
    until = min(story.every("outlier"), default=math.inf)
    off = story.error > RIGHT
    wrong = story.time[story.within(evidence, until) & off]
    took = float(wrong[-1]) - evidence if wrong.size else 0.0
    sure = (story.health == HealthState.TRACKING.value) & (story.error > 10.0)
    return [
        at_most("right (5 m) within 10 s of evidence", took, FOUND),
        at_most("tracking while 10 m off, s", float(sure.sum()) * _interval(story), 0.5),
    ]


def _resets(story: Story, least: int) -> Check:
    steps = float(story.resets[-1] - story.resets[0])
    return between("one step of reset_counter", steps, least, 1)


def _unmoved(story: Story) -> Check:
    moved = [
        story.worst(time, time + WATCHED) - story.worst(time - 0.5, time) for time in story.every("outlier")
    ]
    worst = max(moved, default=math.nan)
    return Check("no outlier of 300 m moves it by 5 m", worst < MOVED, known(worst))


def _interval(story: Story) -> float:
    return float(np.median(np.diff(story.time)))
