"""What a tick costs on this machine at several counts, and how many particles fit into a budget.

The measuring is the daemon's own rehearsal: the estimator of the configuration, fed with invented readings from each
of its sensors in every tick, so every stage runs in every tick. In operation caches belong to others between ticks, and
what is published is sent; the governor, who measures there, affords less.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import median

from service.config import Configuration
from service.rehearsal import costs, line
from service.tick_costs import Line

COUNTS = (200, 1_000, 3_000, 10_000, 30_000, 100_000, 300_000)
ROUNDS = 3


@dataclass(frozen=True)
class Point:
    """A tick's processor time at one count, seconds.

    Attributes
    ----------
    count : int
        Particles.
    stages : dict[str, float]
        Median over the rounds of each stage.
    tick, least, most : float
        All stages together: median, least and greatest round.
    """

    count: int
    stages: dict[str, float]
    tick: float
    least: float
    most: float


def measure(
    configuration: Configuration, counts: Sequence[int], progress: Callable[[int], object]
) -> list[Point]:
    """Return the cost at every count; the rounds go through all of them in turn."""
    found: dict[int, list[dict[str, float]]] = {count: [] for count in counts}
    for _ in range(ROUNDS):
        for count in counts:
            found[count].append(costs(configuration, count))
            progress(count)
    return [_point(count, rounds) for count, rounds in found.items()]


def _point(count: int, rounds: list[dict[str, float]]) -> Point:
    totals = [sum(stages.values()) for stages in rounds]
    stages = {stage: median(found[stage] for found in rounds) for stage in rounds[0]}
    return Point(count, stages, median(totals), min(totals), max(totals))


def shapes(points: Sequence[Point]) -> dict[str, Line]:
    """Return overhead and cost per particle of every stage: the line through the first and the last point."""
    first, last = points[0], points[-1]
    return {
        stage: line(first.count, first.stages[stage], last.count, last.stages[stage])
        for stage in first.stages
    }


def affordable(points: Sequence[Point], budget: float) -> int:
    """Return the largest count whose tick costs no more than ``budget`` seconds, interpolated; 0 if none does.

    Beyond the largest count that was measured, the cost is taken to grow as between the last two.
    """
    if points[0].tick > budget:
        return 0
    for before, after in pairwise(points):
        if after.tick > budget or after is points[-1]:
            slope = max(after.tick - before.tick, 1e-12) / (after.count - before.count)
            count = int(before.count + (budget - before.tick) / slope)
            if after.tick > budget or count > after.count:
                return max(count, before.count)
    return points[-1].count
