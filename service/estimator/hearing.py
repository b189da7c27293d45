"""What was measured in the last seconds, as a likelihood of the pose at one moment, whatever the sensors.

The models that weigh the particles are asked, so a new kind of sensor needs nothing here. A measurement from before or
after the moment is compared with where the supposed vehicle was then (:mod:`service.estimator.way`), and where the
process noise since makes that uncertain, the measurement's own sigma is widened by it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from filters.particle_set import ParticleSet
from filters.sensing import (
    Heading,
    HeadingMeasurement,
    Position,
    PositionMeasurement,
    Range,
    RangeBearing,
    RangeBearingMeasurement,
    RangeMeasurement,
)
from filters.sensing.altitude import Altitude, AltitudeMeasurement
from filters.sensing.biased_range import BiasedRange, BiasedRangeMeasurement
from service.estimator.measuring import Measurement
from service.estimator.way import Shape

Array = NDArray[np.float64]

UNKNOWN_BIAS = 1e4
"""Metres: an altitude whose bias nobody has learned yet says nothing."""


class Heard(NamedTuple):
    """A measurement, when it was made (nanoseconds), and the log evidence that the running belief gave it."""

    time: int
    measured: Measurement
    log_mean: float
    surprise: float


class Likelihood:
    """Of the pose at a moment, given measurements about that time.

    Parameters
    ----------
    names : sequence of str
        The belief's dimensions: sensor models may look at any.
    heard : sequence of Heard
        The measurements.
    shape : Shape
        The way at their times, relative to the moment.
    """

    def __init__(self, names: Sequence[str], heard: Sequence[Heard], shape: Shape) -> None:
        self._shape = shape
        self._names = tuple(names)
        self._models = [one.measured.model for one in heard]
        self._values = [
            widened(one.measured, float(variance), float(turn))
            for one, variance, turn in zip(heard, shape.variance, shape.turn_variance, strict=True)
        ]
        self._particles = ParticleSet(self._names, 0)

    def log(self, columns: Mapping[str, Array]) -> Array:
        """Return the log likelihood, with its constants, of those who are at ``columns`` (n,) at the moment: (n,)."""
        particles = self._sized(columns["north"].size)
        poses = self._shape.poses(columns)
        for name, row in particles.rows.items():
            if row > 2:
                particles.columns[row] = columns[name]
        total = np.zeros(particles.count)
        for index, (model, value) in enumerate(zip(self._models, self._values, strict=True)):
            particles.columns[0] = poses.north[index]
            particles.columns[1] = poses.east[index]
            particles.columns[2] = poses.heading[index]
            particles.log_weights[:] = 0.0
            total += model.weigh(particles, 0, particles.count, value)
            total += particles.log_weights
        return total

    def _sized(self, count: int) -> ParticleSet:
        if self._particles.capacity != count:
            self._particles = ParticleSet(self._names, count)
            self._particles.count = count
        return self._particles


def widened(measured: Measurement, variance: float, turn_variance: float) -> Any:
    """Return the value with its own variance and those of the place (m², per axis) and heading (rad²) it is of."""
    value: tuple[float | None, ...] = measured.value
    widen = _WIDEN.get(type(value))
    return measured.value if widen is None else widen(measured, variance, turn_variance)


def _range(measured: Measurement, variance: float, _turn: float) -> RangeMeasurement | BiasedRangeMeasurement:
    model = cast(Range | BiasedRange, measured.model)
    value = cast(RangeMeasurement | BiasedRangeMeasurement, measured.value)
    sigma = model.sigma if value.sigma is None else value.sigma
    return value._replace(sigma=math.sqrt(sigma * sigma + variance))


def _position(measured: Measurement, variance: float, _turn: float) -> PositionMeasurement:
    model, value = cast(Position, measured.model), cast(PositionMeasurement, measured.value)
    north = model.sigma if value.sigma_north is None else value.sigma_north
    east = north if value.sigma_east is None else value.sigma_east
    return value._replace(
        sigma_north=math.sqrt(north * north + variance), sigma_east=math.sqrt(east * east + variance)
    )


def _landmark(measured: Measurement, variance: float, turn: float) -> RangeBearingMeasurement:
    model, value = cast(RangeBearing, measured.model), cast(RangeBearingMeasurement, measured.value)
    distance = model.sigma_distance if value.sigma_distance is None else value.sigma_distance
    bearing = model.sigma_bearing if value.sigma_bearing is None else value.sigma_bearing
    across = variance / max(value.distance, distance) ** 2
    return value._replace(
        sigma_distance=math.sqrt(distance * distance + variance),
        sigma_bearing=math.sqrt(bearing * bearing + turn + across),
    )


def _heading(measured: Measurement, _variance: float, turn: float) -> HeadingMeasurement:
    model, value = cast(Heading, measured.model), cast(HeadingMeasurement, measured.value)
    sigma = model.sigma if value.sigma is None else value.sigma
    return value._replace(sigma=math.sqrt(sigma * sigma + turn))


def _altitude(measured: Measurement, _variance: float, _turn: float) -> AltitudeMeasurement:
    """Return an altitude; of one with a bias nothing is known here."""
    value = cast(AltitudeMeasurement, measured.value)
    return value if cast(Altitude, measured.model).bias is None else value._replace(sigma=UNKNOWN_BIAS)


_WIDEN: dict[type, Callable[[Measurement, float, float], Any]] = {
    RangeMeasurement: _range,
    BiasedRangeMeasurement: _range,
    RangeBearingMeasurement: _landmark,
    PositionMeasurement: _position,
    HeadingMeasurement: _heading,
    AltitudeMeasurement: _altitude,
}
