"""What a report draws, thinned: a page holds a few thousand points of each series, however long the log was.

Time is cut into as many stretches as there may be points. Of each stretch the first tick is kept, and the tick with the
largest error (or the widest region, without a truth): a thinned line still shows its worst moment.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from service.replay.trace import HEALTH, Innovations, Trace
from service.score import CHI_SQUARE_95, Comparison, Track, Truth, compare

Column = NDArray[np.float64]
STRETCHES = 1200
"""Up to twice as many points of each series."""

READINGS = 1500
"""Most innovations shown of one sensor; outliers among them are all kept, up to as many again."""

ELLIPSES = 60
"""How many regions are drawn along the track."""


@dataclass(frozen=True)
class Series:
    """One run, thinned; times are seconds since its first tick.

    Attributes
    ----------
    ticks : dict[str, (n,) float64]
        As in :class:`~service.replay.trace.Trace`, with time from 0; and error, nees, shadow_north, shadow_east,
        shadow_error, shadow_nees (NaN where not known), and value and sigma of each slow state as ``slow/NAME`` and
        ``slow_sigma/NAME``.
    truth : (2, m) float64 or None
        North and east of the truth during the run.
    start : float
        Unix seconds of the first tick.
    """

    ticks: dict[str, Column]
    truth: Column | None
    innovations: dict[str, Innovations]
    slow: tuple[str, ...]
    start: float


def series_of(trace: Trace, truth: Truth | None) -> Series:
    """Return what a page draws of ``trace``."""
    start = float(trace.ticks["time"][0])
    columns = dict(trace.ticks) | {f"shadow_{name}": trace.shadow[name] for name in ("north", "east")}
    own, shadow = _beside(trace.track(), truth), _beside(trace.shadow_track(), truth)
    columns |= {"error": own.error, "nees": own.nees}
    columns |= {"shadow_error": shadow.error, "shadow_nees": shadow.nees}
    for name, (value, sigma) in trace.slow.items():
        columns |= {f"slow/{name}": value, f"slow_sigma/{name}": sigma}
    kept = thinned(columns["radius95"] if truth is None else own.error)
    ticks = {name: column[kept] for name, column in columns.items()}
    ticks["time"] = ticks["time"] - start
    return Series(
        ticks,
        None if truth is None else _truth_of(trace, truth),
        {name: _readings(readings, start) for name, readings in trace.innovations.items()},
        tuple(trace.slow),
        start,
    )


def _beside(track: Track, truth: Truth | None) -> Comparison:
    if truth is None:
        unknown = np.full(track.time.size, np.nan)
        return Comparison(unknown, unknown, unknown, unknown)
    return compare(track, truth)


def thinned(worst: Column, stretches: int = STRETCHES) -> NDArray[np.int64]:
    """Return which ticks to keep: of each stretch the first, and the one where ``worst`` is largest."""
    count = worst.size
    if count <= 2 * stretches:
        return np.arange(count)
    edges = np.linspace(0, count, stretches + 1).astype(np.int64)
    ranked = np.nan_to_num(worst, nan=-np.inf)
    peaks = [int(first) + int(np.argmax(ranked[first:last])) for first, last in pairwise(edges)]
    return np.unique(np.concatenate([edges[:-1], np.asarray(peaks, np.int64), [count - 1]]))


def _truth_of(trace: Trace, truth: Truth) -> Column:
    time = trace.ticks["time"]
    during = (truth.time >= time[0]) & (truth.time <= time[-1])
    way = np.vstack([truth.north[during], truth.east[during]])
    return way[:, :: max(1, way.shape[1] // (2 * STRETCHES))]


def _readings(readings: Innovations, start: float) -> Innovations:
    kept = np.union1d(
        _spaced(np.flatnonzero(~readings.outlier)), _spaced(np.flatnonzero(readings.outlier))
    ).astype(np.int64)
    return Innovations(
        readings.time[kept] - start,
        readings.value[kept],
        readings.sigma[kept],
        readings.outlier[kept],
        readings.dimensions,
    )


def _spaced(indices: NDArray[np.int64]) -> NDArray[np.int64]:
    return indices[:: max(1, -(-indices.size // READINGS))]


@dataclass(frozen=True)
class Ellipses:
    """95 % regions: centres (north, east), full axes (m), and the major axis' direction clockwise from north (rad)."""

    north: Column
    east: Column
    major: Column
    minor: Column
    direction: Column


def ellipses(ticks: dict[str, Column], most: int = ELLIPSES) -> Ellipses:
    """Return the 95 % regions of evenly spaced ticks that had one."""
    known = np.flatnonzero(np.isfinite(ticks["nn"]))
    chosen = known[:: max(1, -(-known.size // most))]
    nn, ne, ee = (ticks[name][chosen] for name in ("nn", "ne", "ee"))
    matrices = np.stack([np.stack([nn, ne], -1), np.stack([ne, ee], -1)], -2)
    variances, axes = np.linalg.eigh(matrices.reshape(-1, 2, 2))
    lengths = 2.0 * np.sqrt(CHI_SQUARE_95 * np.maximum(variances, 0.0))
    return Ellipses(
        ticks["north"][chosen],
        ticks["east"][chosen],
        lengths[:, 1],
        lengths[:, 0],
        np.arctan2(axes[:, 1, 1], axes[:, 0, 1]),
    )


@dataclass(frozen=True)
class Stretch:
    """One state of health, from when to when (seconds)."""

    state: str
    begin: float
    end: float


def stretches_of_health(time: Column, health: Column) -> list[Stretch]:
    """Return the states of health one after the other; each lasts until the next begins."""
    changes = np.flatnonzero(np.diff(health)) + 1
    edges = [0, *changes.tolist(), time.size]
    return [
        Stretch(
            HEALTH[int(health[first])].value,
            float(time[first]),
            float(time[min(last, time.size - 1)]),
        )
        for first, last in pairwise(edges)
        if last > first
    ]
