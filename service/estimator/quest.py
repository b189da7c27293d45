"""One search for the place where the vehicle was at a moment, in a box, given what was measured about that time.

First the histogram filter says where the mass is: a coarse grid over the box, weighed by the newest reading of every
sensor, each widened by what a cell, the way and the slow states leave open. Then points are drawn there, with headings
and slow states as they may be, and annealed into the likelihood of all measurements along the way
(:class:`~filters.annealed.AnnealedSampler`). Nothing depends on the belief that runs beside it. The work comes in
pieces.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from filters.annealed import AnnealedSampler
from filters.grid import Axis, Columns, Grid
from filters.histogram import HistogramFilter
from filters.sensing import (
    Position,
    PositionMeasurement,
    Range,
    RangeBearing,
    RangeBearingMeasurement,
    RangeMeasurement,
)
from filters.sensing.biased_range import BiasedRange, BiasedRangeMeasurement
from service.config import Configuration
from service.estimator.hearing import Heard, Likelihood
from service.estimator.start import Anchor, draw
from service.estimator.way import Way

Array = NDArray[np.float64]

POINTS = 2048
"""Points that are annealed."""

PIECE = 512
"""Of them, how many are looked at in one piece of work."""

CELLS = 64
"""Of the coarse grid, along each side of the box."""

EVERYWHERE = 0.1
"""Share of the points that are drawn from all over the box: the grid looks at a part of what is known."""

DOUBT = 0.5
"""Power of the likelihoods: measurements a tenth of a second apart are not as independent as their models say."""

ANYWHERE = Anchor((0.0, 0.0, None), (0.0, 0.0, 0.0))


class Box(NamedTuple):
    """Bounds of a search, metres."""

    north: tuple[float, float]
    east: tuple[float, float]

    @property
    def area(self) -> float:
        """Square metres."""
        return (self.north[1] - self.north[0]) * (self.east[1] - self.east[0])

    def holds(self, north: Array, east: Array) -> NDArray[np.bool_]:
        """Say which places lie in it."""
        return (
            (north >= self.north[0])
            & (north <= self.north[1])
            & (east >= self.east[0])
            & (east <= self.east[1])
        )


class Quest:
    """A search, piece by piece.

    Parameters
    ----------
    configuration : Configuration
        What is known of heading and slow states before anything is measured.
    names : sequence of str
        The belief's dimensions.
    way : Way
        How the vehicle moved.
    heard : sequence of Heard
        What was measured, in order.
    moment : int
        Whose pose is sought, nanoseconds.
    box : Box
        Where.
    key : (int, int)
        Of the random numbers.

    Attributes
    ----------
    done : bool
        Whether there is nothing left to do.
    log_evidence : float
        Logarithm of the evidence for "somewhere in the box", to the power of :data:`DOUBT`.
    """

    def __init__(
        self,
        configuration: Configuration,
        names: Sequence[str],
        way: Way,
        heard: Sequence[Heard],
        moment: int,
        box: Box,
        key: tuple[int, int],
    ) -> None:
        self.moment = moment
        self.box = box
        self.done = False
        self.log_evidence = -math.inf
        self._names = tuple(names)
        self._heard = list(heard)
        self._shape = way.shape(moment, [one.time for one in heard])
        self._likelihood = Likelihood(names, self._heard, self._shape)
        self._generator = np.random.Generator(np.random.Philox(key=np.array(key, np.uint64)))
        start = configuration.start
        known = start.mode == "global" and start.heading is not None and start.sigma_heading is not None
        prior = draw(configuration, self._names, POINTS, key[0] + key[1], ANYWHERE)
        if not known and prior["heading"].any():
            prior["heading"] = self._generator.uniform(-math.pi, math.pi, POINTS).astype(np.float32)
        self._heading = (start.heading, start.sigma_heading) if known else None
        self._known = {name: (float(column.mean()), float(column.std())) for name, column in prior.items()}
        self._known |= way.unknowns
        self._columns = {name: column.astype(np.float64) for name, column in prior.items()}
        for name, (mean, sigma) in way.unknowns.items():
            self._columns[name] = self._generator.normal(mean, sigma, POINTS)
        self._open = [
            name
            for name, column in self._columns.items()
            if name not in ("north", "east") and float(np.ptp(column)) > 0.0
        ]
        self._work = self._run()

    def advance(self) -> bool:
        """Do one piece of work; return whether all is done."""
        if not self.done and next(self._work, None) is None:
            self.done = True
        return self.done

    @property
    def columns(self) -> dict[str, Array]:
        """Where the vehicle was at the moment: (POINTS,) each, equally likely, by name; the way's unknowns too."""
        return self._columns

    def _run(self) -> Iterator[bool]:
        coarse = HistogramFilter(Grid((Axis(*self.box.north, CELLS), Axis(*self.box.east, CELLS))))
        for index in _newest(self._heard):
            log = self._coarse(index, coarse.grid.widths)
            if log is not None:
                coarse.update(log)
                yield True
        self._scatter(coarse)
        yield True
        sampler = AnnealedSampler(
            self._points(),
            lambda points: self._log_start(points, coarse),
            self._log_target,
            self._generator,
            wraps=[2 + self._open.index("heading")] if "heading" in self._open else (),
            piece=PIECE,
        )
        while not sampler.advance():
            yield True
        self.log_evidence = sampler.log_evidence
        self._columns |= self._named(sampler.points)

    # --- where the mass is ------------------------------------------------------------------------------------------

    def _coarse(self, index: int, widths: Array) -> Coarse | None:
        """Return what a measurement says of a cell, whatever heading and slow states are."""
        one = self._heard[index]
        value, model = one.measured.value, one.measured.model
        cell = float(widths @ widths) / 12.0
        blur = cell + float(self._shape.variance[index]) + 0.5 * float(self._shape.reach[index]) ** 2
        if isinstance(value, RangeMeasurement | BiasedRangeMeasurement):
            range_model = cast("Range | BiasedRange", model)
            scale, scale_sigma = self._known.get(range_model.scale or "", (1.0, 0.0))
            name = range_model.bias if isinstance(range_model, Range) else None
            bias, bias_sigma = self._known.get(name or "", (0.0, 0.0))
            sigma = range_model.sigma if value.sigma is None else value.sigma
            slow = (
                bias_sigma**2
                + (scale_sigma * value.distance) ** 2
                + self._known.get("down", (0.0, 0.0))[1] ** 2
            )
            return Coarse(
                value.north,
                value.east,
                value.down_difference,
                scale,
                value.distance - bias,
                math.sqrt(sigma * sigma + blur + slow),
                range_model.outliers,
                range_model.span,
            )
        if isinstance(value, RangeBearingMeasurement) and value.north is not None and value.east is not None:
            landmark = cast(RangeBearing, model)
            sigma = landmark.sigma_distance if value.sigma_distance is None else value.sigma_distance
            where = value.north, value.east, 0.0, 1.0, value.distance
            return Coarse(*where, math.sqrt(sigma * sigma + blur), landmark.outliers, landmark.span)
        if isinstance(value, PositionMeasurement):
            position = cast(Position, model)
            sigma = position.sigma if value.sigma_north is None else value.sigma_north
            return Coarse(
                value.north,
                value.east,
                0.0,
                1.0,
                0.0,
                math.sqrt(sigma * sigma + blur),
                position.outliers,
                position.span,
            )
        return None

    def _scatter(self, coarse: HistogramFilter) -> None:
        """Draw the places: most by the grid, some from all over the box."""
        places = coarse.draw(POINTS, self._generator)
        anywhere = self._generator.random(POINTS) < EVERYWHERE
        spread = self._generator.random((POINTS, 2))
        for axis, (name, (low, high)) in enumerate(zip(("north", "east"), self.box, strict=True)):
            self._columns[name] = np.where(anywhere, low + (high - low) * spread[:, axis], places[:, axis])

    # --- annealing --------------------------------------------------------------------------------------------------

    def _points(self) -> Array:
        return np.stack([self._columns[name] for name in ("north", "east", *self._open)], axis=1)

    def _named(self, points: Array) -> dict[str, Array]:
        return {name: points[:, axis] for axis, name in enumerate(("north", "east", *self._open))}

    def _log_prior(self, points: Array) -> Array:
        """Log density of heading and slow states before anything was measured."""
        total = np.zeros(len(points))
        for axis, name in enumerate(self._open, 2):
            if name != "heading":
                total += _log_normal(points[:, axis], *self._known[name])
            elif self._heading is None:
                total -= math.log(2.0 * math.pi)
            else:
                mean, sigma = cast("tuple[float, float]", self._heading)
                away = np.remainder(points[:, axis] - mean + math.pi, 2.0 * math.pi) - math.pi
                total += _log_normal(away, 0.0, sigma)
        return total

    def _log_start(self, points: Array, coarse: HistogramFilter) -> Array:
        inside = self.box.holds(points[:, 0], points[:, 1])
        density = (1.0 - EVERYWHERE) * coarse.evaluate(points[:, :2]) + EVERYWHERE / self.box.area * inside
        with np.errstate(divide="ignore"):
            return np.log(density) + self._log_prior(points)

    def _log_target(self, points: Array) -> Array:
        columns: Mapping[str, Array] = {
            name: column[: len(points)] for name, column in self._columns.items()
        } | self._named(points)
        total = DOUBT * self._likelihood.log(columns) + self._log_prior(points) - math.log(self.box.area)
        total[~self.box.holds(points[:, 0], points[:, 1])] = -math.inf
        return total


class Coarse(NamedTuple):
    """A robust likelihood of the place alone: a distance to a point, or a place (distance 0)."""

    north: float
    east: float
    down: float
    scale: float
    distance: float
    sigma: float
    outliers: float
    span: float

    def __call__(self, states: Columns) -> Array:
        """Return its logarithm, up to a constant, to the power of :data:`DOUBT`."""
        square = (states[0] - self.north) ** 2 + (states[1] - self.east) ** 2 + self.down**2
        if self.distance == 0.0:
            square, dimensions = square / self.sigma**2, 2
        else:
            square, dimensions = ((self.scale * np.sqrt(square) - self.distance) / self.sigma) ** 2, 1
        inlier = math.log1p(-self.outliers) - dimensions * math.log(self.sigma * math.sqrt(2.0 * math.pi))
        if self.outliers == 0.0:
            return DOUBT * (inlier - 0.5 * square)
        outlier = math.log(self.outliers) - dimensions * math.log(self.span)
        return DOUBT * np.logaddexp(inlier - 0.5 * square, outlier)


def _newest(heard: Sequence[Heard]) -> list[int]:
    """Return the place of the last measurement of every sensor and beacon."""
    return list({one.measured.name: index for index, one in enumerate(heard)}.values())


def _log_normal(values: Array, mean: float, sigma: float) -> Array:
    return -0.5 * ((values - mean) / sigma) ** 2 - math.log(sigma * math.sqrt(2.0 * math.pi))
