"""Runs made by hand: published figures tick by tick, with a truth that stands still."""

from __future__ import annotations

import numpy as np

from service.checks import Event, Flag, Story
from service.score import Track, Truth

BEGIN = 1_700_000_000.0


def told(
    error: np.ndarray,
    *,
    events: tuple[tuple[float, str], ...] = (),
    hypotheses: np.ndarray | None = None,
    resets: np.ndarray | None = None,
    health: np.ndarray | None = None,
    slipping: np.ndarray | None = None,
    flags: tuple[tuple[str, float, float], ...] = (),
    sigma: float = 1.0,
) -> Story:
    """Return a run of ten ticks a second whose position is off by ``error``; times are seconds since its begin."""
    count = len(error)
    time = BEGIN + np.arange(count) / 10.0
    track = Track(time, error, np.zeros(count), np.tile([sigma**2, 0.0, sigma**2], (count, 1)))
    story = Story(
        track,
        np.ones(count) if hypotheses is None else hypotheses,
        np.zeros(count) if resets is None else resets,
        np.full(count, "tracking") if health is None else health,
        np.zeros(count, np.bool_) if slipping is None else slipping,
        tuple(Flag(sensor, BEGIN + begin, BEGIN + end) for sensor, begin, end in flags),
    )
    truth = Truth(np.array([BEGIN, BEGIN + count]), np.zeros(2), np.zeros(2))
    return story.beside(truth, tuple(Event(BEGIN + at, name) for at, name in events))


def seconds(length: float) -> np.ndarray:
    """Return the times of a run of that length, ten a second, since its begin."""
    return np.arange(round(10.0 * length)) / 10.0


def answers(checks: list) -> dict[str, tuple[bool, float | None]]:
    """Return the answers by question."""
    return {check.name: (check.passed, check.found) for check in checks}
