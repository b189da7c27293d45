"""A run written down tick by tick, for its report: the estimates, the shadow's, and every sensor's innovations."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from filters.belief import Evidence
from filters.linearised.shadow import LINEARISED
from service.estimate import Estimate, HealthState
from service.estimator.binding import Measurement
from service.estimator.carrier import Pose
from service.score import Track

Column = NDArray[np.float64]
HEALTH = tuple(HealthState)
"""Health states by the numbers that a trace holds."""

_TICK = (
    "time",
    "north",
    "east",
    "nn",
    "ne",
    "ee",
    "radius95",
    "health",
    "particles",
    "demanded",
    "afforded",
    "level",
)
_SHADOW = ("north", "east", "nn", "ne", "ee")


@dataclass(frozen=True)
class Innovations:
    """What one sensor's readings said of the belief, in the order in which they were weighed.

    Attributes
    ----------
    time : (n,) float64
        Unix seconds at which the reading was true.
    value : (n,) float64
        Measured less expected, in the reading's unit; the length of that vector for readings of two dimensions.
    sigma : (n,) float64
        Standard deviation that the belief and the sensor's own claim say it has, per dimension; NaN where the model
        has no derivative.
    outlier : (n,) bool
        Whether the belief took it for one.
    dimensions : int
        Of a reading.
    """

    time: Column
    value: Column
    sigma: Column
    outlier: NDArray[np.bool_]
    dimensions: int


@dataclass(frozen=True)
class Trace:
    """One run, a row a tick; NaN where there was no belief.

    Attributes
    ----------
    ticks : dict[str, (n,) float64]
        time (Unix s), north, east, nn, ne, ee, radius95, health (index into :data:`HEALTH`), particles, demanded,
        afforded, level.
    shadow : dict[str, (n,) float64]
        The shadow's north, east, nn, ne, ee.
    slow : dict[str, tuple[(n,) float64, (n,) float64]]
        Slow states: value and sigma.
    innovations : dict[str, Innovations]
        By sensor.
    """

    ticks: dict[str, Column]
    shadow: dict[str, Column]
    slow: dict[str, tuple[Column, Column]]
    innovations: dict[str, Innovations]

    def track(self) -> Track:
        """Return the particle filter's track, with NaN where it had no position."""
        return _track(self.ticks["time"], self.ticks)

    def shadow_track(self) -> Track:
        """Return the shadow's track, with NaN where it had no position."""
        return _track(self.ticks["time"], self.shadow)


def _track(time: Column, columns: dict[str, Column]) -> Track:
    covariance = np.column_stack([columns[name] for name in ("nn", "ne", "ee")])
    return Track(time, columns["north"], columns["east"], covariance)


class _Readings:
    """Innovations of one sensor under construction."""

    def __init__(self) -> None:
        self.rows: list[tuple[float, float, float, float]] = []
        self.dimensions = 1

    def arrays(self) -> Innovations:
        time, value, sigma, outlier = np.asarray(self.rows, np.float64).reshape(-1, 4).T
        return Innovations(time, value, sigma, outlier > 0.5, self.dimensions)


class Tracer:
    """Writes a run down; a companion of the estimator, for the innovations.

    The scale of an innovation comes from the covariance of the tick before and the sensor's derivative there. The
    moments of the very instant would be exact, and asking for them would normalise the weights once more.
    """

    def __init__(self) -> None:
        self._rows: list[tuple[float, ...]] = []
        self._shadow: list[tuple[float, ...]] = []
        self._slow: list[dict[str, tuple[float, float]]] = []
        self._readings: dict[str, _Readings] = {}
        self._last: Estimate | None = None

    # --- as a companion -----------------------------------------------------------------------------------------

    def started(self, time: int) -> None:
        """Begin anew: the covariance of the belief before says nothing."""
        self._last = None

    def moved(self, start: int, end: int) -> None:
        """Motion leaves no innovation."""

    def weighed(self, time: int, measured: Measurement, evidence: Evidence, outlier: bool) -> None:
        """Note an innovation."""
        readings = self._readings.setdefault(measured.name, _Readings())
        sigma, readings.dimensions = self._expected(measured)
        readings.rows.append((time / 1e9, evidence.innovation, sigma, float(outlier)))

    def _expected(self, measured: Measurement) -> tuple[float, int]:
        """Return the innovation's standard deviation per dimension, and how many dimensions it has."""
        make, last = LINEARISED.get(type(measured.model)), self._last
        if make is None or last is None or last.heading is None or last.heading_variance is None:
            return math.nan, 1
        rows, mean, covariance = gaussian(last)
        try:
            expectation = make(measured.model).expect(rows, mean, measured.value)
        except KeyError:  # a slow state that is not published
            return math.nan, 1
        jacobian = expectation.jacobian
        spread = jacobian @ covariance @ jacobian.T + expectation.noise
        dimensions = len(spread)
        return math.sqrt(max(0.0, float(np.trace(spread)) / dimensions)), dimensions

    # --- by the replay ------------------------------------------------------------------------------------------

    def add(self, estimate: Estimate, shadow: Pose | None) -> None:
        """Write one tick down."""
        self._last = estimate if estimate.heading is not None else None
        nn, ne, _, ee, _, _ = estimate.position_covariance
        known = (*estimate.position[:2], nn, ne, ee, estimate.radius95)
        counts = (estimate.particles, estimate.demanded, estimate.afforded, estimate.level)
        figures = (math.nan if value is None else value for value in known)
        self._rows.append((estimate.time, *figures, HEALTH.index(estimate.health), *counts))
        self._slow.append(estimate.biases)
        if shadow is None:
            self._shadow.append((math.nan,) * len(_SHADOW))
        else:
            c = shadow.covariance
            pose = (shadow.mean("north"), shadow.mean("east"), float(c[0, 0]), float(c[0, 1]), float(c[1, 1]))
            self._shadow.append(pose)

    def trace(self) -> Trace:
        """Return what was written."""
        ticks = np.asarray(self._rows, np.float64).reshape(-1, len(_TICK)).T
        shadow = np.asarray(self._shadow, np.float64).reshape(-1, len(_SHADOW)).T
        names = dict.fromkeys(name for biases in self._slow for name in biases)
        return Trace(
            dict(zip(_TICK, ticks, strict=True)),
            dict(zip(_SHADOW, shadow, strict=True)),
            {name: self._slow_state(name) for name in names},
            {name: readings.arrays() for name, readings in sorted(self._readings.items())},
        )

    def _slow_state(self, name: str) -> tuple[Column, Column]:
        unknown = (math.nan, math.nan)
        value, sigma = np.asarray([biases.get(name, unknown) for biases in self._slow], np.float64).T
        return value, sigma


def gaussian(estimate: Estimate) -> tuple[dict[str, int], Column, Column]:
    """Return an estimate as rows by name, a mean and a covariance, as linearised sensors take them.

    Slow states stand beside the pose uncorrelated: an estimate says no more of them. The pose's heading does, too.
    """
    names = ("north", "east", "heading", *estimate.biases)
    north, east, _ = estimate.position
    pose = [math.nan if value is None else value for value in (north, east, estimate.heading)]
    mean = np.array([*pose, *(value for value, _ in estimate.biases.values())], np.float64)
    nn, ne, _, ee, _, _ = estimate.position_covariance
    variances = [nn or 0.0, ee or 0.0, estimate.heading_variance or 0.0]
    covariance = np.diag([*variances, *(sigma**2 for _, sigma in estimate.biases.values())])
    covariance[0, 1] = covariance[1, 0] = ne or 0.0
    return {name: row for row, name in enumerate(names)}, mean, covariance
