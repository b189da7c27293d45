"""A run as a checker sees it: what was published tick by tick, beside the truth and what befell the drive."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from service.checks.events import Event
from service.estimate import Estimate, HealthState, MotionMode, SensorStatus
from service.score import UNSCORED, Comparison, Score, Track, Truth, compare, figures

Column = NDArray[np.float64]

ASKED = 0.2
"""Seconds between two looks at the sensors' trust."""


class Flag(NamedTuple):
    """A stretch in which a sensor was not trusted, Unix seconds; ``end`` is infinite while it lasts."""

    sensor: str
    begin: float
    end: float


@dataclass
class Teller:
    """Writes a run down, tick by tick."""

    _rows: list[tuple[float, ...]] = field(default_factory=list[tuple[float, ...]])
    _health: list[HealthState] = field(default_factory=list[HealthState])
    _slipping: list[bool] = field(default_factory=list[bool])
    _open: dict[str, float] = field(default_factory=dict[str, float])
    _flags: list[Flag] = field(default_factory=list[Flag])
    _asked: float = -math.inf

    def add(self, estimate: Estimate) -> None:
        """Write one tick down."""
        nn, ne, _, ee, _, _ = estimate.position_covariance
        known = (*estimate.position[:2], nn, ne, ee)
        figures = (math.nan if value is None else value for value in known)
        self._rows.append((estimate.time, *figures, estimate.hypotheses, estimate.reset_counter))
        self._health.append(estimate.health)
        self._slipping.append(estimate.mode is MotionMode.SLIPPING)

    def due(self, time: float) -> bool:
        """Say whether it is time to ask the sensors."""
        return time - self._asked >= ASKED

    def ask(self, time: float, sensors: Iterable[SensorStatus]) -> None:
        """Note who is trusted at ``time``, Unix seconds: log odds below zero are a flag."""
        self._asked = time
        for sensor in sensors:
            lies = sensor.trust is not None and sensor.trust < 0.0
            if lies and sensor.name not in self._open:
                self._open[sensor.name] = time
            elif not lies and sensor.name in self._open:
                self._flags.append(Flag(sensor.name, self._open.pop(sensor.name), time))

    def story(self) -> Story:
        """Return the run as it was told so far."""
        lasting = [Flag(sensor, begin, math.inf) for sensor, begin in self._open.items()]
        table = np.asarray(self._rows, np.float64).reshape(-1, 8).T
        track = Track(table[0], table[1], table[2], table[3:6].T)
        health = np.asarray([state.value for state in self._health])
        flags = tuple(sorted([*self._flags, *lasting], key=lambda flag: flag.begin))
        return Story(track, table[6], table[7], health, np.asarray(self._slipping, np.bool_), flags)


@dataclass
class Story:
    """A run.

    Attributes
    ----------
    track : Track
        A row a tick; NaN where there was no position.
    hypotheses, resets : (n,) float64
        Published in each tick: how many places, and the reset counter.
    health : (n,) str
        Health of each tick.
    slipping : (n,) bool
        Whether slipping wheels were reported.
    flags : tuple[Flag, ...]
        When which sensor was not trusted.
    comparison : Comparison or None
        The track beside the truth; :meth:`beside` makes it.
    events : tuple[Event, ...]
        What befell the drive.
    """

    track: Track
    hypotheses: Column
    resets: Column
    health: NDArray[np.str_]
    slipping: NDArray[np.bool_]
    flags: tuple[Flag, ...]
    comparison: Comparison | None = None
    events: tuple[Event, ...] = ()

    def beside(self, truth: Truth, events: tuple[Event, ...]) -> Story:
        """Put the truth and the events beside the run."""
        self.comparison = compare(self.track, truth)
        self.events = events
        return self

    @property
    def time(self) -> Column:
        """Unix seconds of the ticks, (n,)."""
        return self.track.time

    @property
    def error(self) -> Column:
        """Horizontal error of each tick, metres; NaN where it is not known."""
        return np.full(len(self.time), np.nan) if self.comparison is None else self.comparison.error

    def row(self) -> dict[str, object]:
        """Return what ``--json`` says of it: seconds in each health, steps of the reset counter, who was flagged when.

        Times are seconds since the first tick; a flag that lasted to the end has no end.
        """
        if not len(self.time):
            return {"health_seconds": {}, "resets": 0, "flags": []}
        begin, interval = (
            float(self.time[0]),
            float(np.median(np.diff(self.time))) if len(self.time) > 1 else 0.0,
        )
        states, counts = np.unique(self.health, return_counts=True)
        return {
            "health_seconds": {
                str(state): round(float(count) * interval, 2)
                for state, count in zip(states, counts, strict=True)
            },
            "resets": int(self.resets[-1] - self.resets[0]),
            "flags": [
                {
                    "sensor": flag.sensor,
                    "from": round(flag.begin - begin, 2),
                    "to": round(flag.end - begin, 2) if math.isfinite(flag.end) else None,
                }
                for flag in self.flags
            ],
        }

    def first(self, name: str) -> float:
        """Return when something befell the drive for the first time, Unix seconds; NaN: never."""
        return next((event.time for event in self.events if event.name == name), math.nan)

    def every(self, name: str) -> list[float]:
        """Return all times at which something befell the drive, Unix seconds."""
        return [event.time for event in self.events if event.name == name]

    def within(self, begin: float, end: float = math.inf) -> NDArray[np.bool_]:
        """Return which ticks lie from ``begin`` until before ``end``, Unix seconds."""
        return (self.time >= begin) & (self.time < end)

    def worst(self, begin: float, end: float = math.inf) -> float:
        """Return the largest error of a stretch, metres; NaN: it is not known."""
        errors = self.error[self.within(begin, end)]
        errors = errors[np.isfinite(errors)]
        return float(errors.max()) if errors.size else math.nan

    def score(self, begin: float = -math.inf, end: float = math.inf) -> Score:
        """Return the figures of a stretch."""
        if self.comparison is None:
            return UNSCORED
        chosen, whole = self.within(begin, end), self.comparison
        return figures(
            Comparison(whole.error[chosen], whole.nees[chosen], whole.log_score[chosen], whole.level[chosen])
        )

    def flagged(self, kind: str, begin: float, end: float = math.inf) -> float:
        """Return when a sensor whose name begins with ``kind`` was first flagged in a stretch; NaN: it was not."""
        times = [
            flag.begin for flag in self.flags if flag.sensor.startswith(kind) and begin <= flag.begin < end
        ]
        return min(times, default=math.nan)

    def trusted(self, kind: str, after: float) -> float:
        """Return when the last flag of sensors named ``kind`` that was raised before ``after`` was taken back."""
        ends = [flag.end for flag in self.flags if flag.sensor.startswith(kind) and flag.begin < after]
        ends = [end for end in ends if end >= after]
        return max(ends, default=math.nan)
