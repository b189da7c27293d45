"""Meters: what every stage of a tick cost, over the last second and over the whole run.

Costs are processor time, lateness and duration are wall time. Everything is allocated once; a tick writes a
few numbers, and only the summary, once a second, sorts them.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from service.estimate import Distribution, StageCost

STAGES = (
    "ingest",
    "motion",
    "sensing",
    "witnesses",
    "resampling",
    "kalman",
    "search",
    "extraction",
    "publishing",
    "cloud",
)
TICK = "tick"
_MILLISECONDS = 1e3
_SHARES = {"median": 0.5, "p99": 0.99, "p999": 0.999, "p9999": 0.9999}


class Ring:
    """The last ``capacity`` values, summarised on demand.

    Raises
    ------
    ValueError
        The capacity is under 1.
    """

    def __init__(self, capacity: int) -> None:
        if capacity < 1:
            raise ValueError(f"a ring needs room for at least one value, got {capacity}")
        self._values: NDArray[np.float64] = np.zeros(capacity)
        self._sorted: NDArray[np.float64] = np.zeros(capacity)
        self._next = 0
        self._held = 0

    def add(self, seconds: float) -> None:
        """Take one value in, over the oldest when the ring is full."""
        self._values[self._next] = seconds
        self._next = (self._next + 1) % len(self._values)
        self._held = min(self._held + 1, len(self._values))

    def cost(self) -> StageCost:
        """Return median, 99th percentile and worst in milliseconds; zeros while nothing has been added.

        Percentiles are values that occurred: the smallest that at least that share does not exceed.
        """
        if not self._held:
            return StageCost(0.0, 0.0, 0.0)
        ordered = self._sorted[: self._held]
        np.copyto(ordered, self._values[: self._held])
        ordered.sort()
        median, p99 = (float(ordered[math.ceil(share * self._held) - 1]) for share in (0.5, 0.99))
        return StageCost(_MILLISECONDS * median, _MILLISECONDS * p99, _MILLISECONDS * float(ordered[-1]))


class Histogram:
    """Counts of a whole run in bins of equal ratio, from 1 µs to 100 s, ten to the octave."""

    LOWEST = 1e-6
    PER_OCTAVE = 10
    _BINS = math.ceil(math.log2(1e8) * PER_OCTAVE)

    def __init__(self) -> None:
        self._counts: NDArray[np.int64] = np.zeros(self._BINS, np.int64)
        self.worst = 0.0
        """The largest value so far, exact."""

    def add(self, seconds: float) -> None:
        """Count one value; what lies outside falls into the first or the last bin."""
        self.worst = max(self.worst, seconds)
        if seconds <= self.LOWEST:
            self._counts[0] += 1
        else:
            self._counts[min(int(math.log2(seconds / self.LOWEST) * self.PER_OCTAVE), self._BINS - 1)] += 1

    @property
    def total(self) -> int:
        """How many values were counted."""
        return int(self._counts.sum())

    def quantile(self, probability: float) -> float:
        """Return the upper edge of the bin that holds the quantile (7 % above it at most); 0.0 when empty."""
        total = self.total
        if not total:
            return 0.0
        rank = max(1, math.ceil(probability * total))
        index = int(np.searchsorted(np.cumsum(self._counts), rank))
        return min(self._edge(index), self.worst)

    def distribution(self) -> Distribution:
        """Return the histogram as it is published: percentiles, and the bins that hold anything."""
        held = np.flatnonzero(self._counts)
        return Distribution(
            ticks=self.total,
            **{name: _MILLISECONDS * self.quantile(share) for name, share in _SHARES.items()},
            worst=_MILLISECONDS * self.worst,
            bins=[
                (round(_MILLISECONDS * self._edge(index), 6), int(self._counts[index]))
                for index in held.tolist()
            ],
        )

    def _edge(self, index: int) -> float:
        """Return the upper edge of a bin, seconds."""
        return self.LOWEST * 2.0 ** ((index + 1) / self.PER_OCTAVE)


class Meters:
    """Measures ticks: a stopwatch for their stages, a ring per stage, and histograms of the whole run.

    Between :meth:`begin` and :meth:`end` every :meth:`lap` charges the processor time since the last one to a
    stage; a stage may have several laps. It is the ``Stopwatch`` that the estimator is given.

    Parameters
    ----------
    rate : float
        Ticks per second: the rings hold one second.
    processor_ns : Callable[[], int]
        Clock of cost. The processor time of the whole process: threads that help are paid from the same
        budget, and being preempted costs nothing.
    """

    def __init__(self, rate: float, processor_ns: Callable[[], int] = time.process_time_ns) -> None:
        self._capacity = max(1, round(rate))
        self._processor_ns = processor_ns
        self._rings = {stage: Ring(self._capacity) for stage in (*STAGES, TICK)}
        self._lateness = Ring(self._capacity)
        self._began = 0
        self._lapped = 0
        self.costs: dict[str, float] = dict.fromkeys(STAGES, 0.0)
        """Seconds of every stage in the tick under way, or in the last one."""
        self.lateness = Histogram()
        """Seconds from a deadline to the start of its tick, whole run."""
        self.durations = Histogram()
        """Seconds of wall time from the start of a tick to its end, whole run."""

    def begin(self) -> None:
        """Start a tick."""
        for stage in self.costs:
            self.costs[stage] = 0.0
        self._began = self._lapped = self._processor_ns()

    def lap(self, stage: str) -> None:
        """Charge the time since the last lap to a stage; one not heard of before gets a ring of its own."""
        now = self._processor_ns()
        self.costs[stage] = self.costs.get(stage, 0.0) + (now - self._lapped) * 1e-9
        self._lapped = now

    @property
    def spent(self) -> float:
        """Seconds of processor time since the tick under way began."""
        return (self._processor_ns() - self._began) * 1e-9

    def end(self, lateness: float, duration: float) -> float:
        """Close a tick, and return what it cost in all, seconds of processor time.

        Parameters
        ----------
        lateness : float
            Seconds of wall time from its deadline to its start.
        duration : float
            Seconds of wall time from its start to its end.
        """
        cost = self.spent
        for stage, seconds in self.costs.items():
            if stage not in self._rings:
                self._rings[stage] = Ring(self._capacity)
            self._rings[stage].add(seconds)
        self._rings[TICK].add(cost)
        self._lateness.add(lateness)
        self.lateness.add(lateness)
        self.durations.add(duration)
        return cost

    def stages(self) -> dict[str, StageCost]:
        """Return the cost of every stage, and of the tick, over the last second."""
        return {stage: ring.cost() for stage, ring in self._rings.items()}

    def recent_lateness(self) -> StageCost:
        """Return the lateness over the last second."""
        return self._lateness.cost()
