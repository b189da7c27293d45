"""Sensor resetting: where to draw particles anew, from what a sensor says rather than from everywhere.

A proposal draws poses from p(x | z) with nothing known before (Lenser and Veloso, "Sensor resetting localization for
poorly modelled mobile robots", ICRA 2000). What it draws goes into
:meth:`filters.particle.ParticleFilter.inject`. A proposal leaves the heading open (uniform) unless told.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from filters.ring import RingDensity, draw_jointly

Array = NDArray[np.float64]


class Proposal(Protocol):
    """The named requirement of a proposal."""

    def draw(self, count: int, generator: np.random.Generator) -> dict[str, Array]:
        """Draw ``count`` poses, independently and in random order: columns (count,) by name."""
        ...


class Heading(NamedTuple):
    """A heading that is known: mean and standard deviation, radians."""

    mean: float
    sigma: float

    def draw(self, count: int, generator: np.random.Generator) -> Array:
        """Draw headings in [-pi, pi), (count,)."""
        return np.remainder(generator.normal(self.mean, self.sigma, count) + math.pi, 2 * math.pi) - math.pi


class Unknown(NamedTuple):
    """A heading of which nothing is known."""

    def draw(self, count: int, generator: np.random.Generator) -> Array:
        """Draw headings in [-pi, pi), (count,)."""
        return generator.uniform(-math.pi, math.pi, count)


class Ring(NamedTuple):
    """A range to a beacon, exactly p(place | range) of a uniform prior over the plane.

    Attributes
    ----------
    north, east : float
        Of the beacon, metres.
    distance, sigma : float
        Measured, metres; slant if ``down`` is not 0.
    down : float
        The beacon's depth below the vehicle, metres.
    heading : Heading or Unknown
        What is known of the heading.
    """

    north: float
    east: float
    distance: float
    sigma: float
    down: float = 0.0
    heading: Heading | Unknown = Unknown()

    @property
    def density(self) -> RingDensity:
        """The ring in the plane.

        Raises
        ------
        ValueError
            A number out of range, or a range that no place can have.
        """
        return RingDensity(self.north, self.east, self.distance, self.sigma, self.down)

    def draw(self, count: int, generator: np.random.Generator) -> dict[str, Array]:
        """Draw poses; raises as :attr:`density`."""
        north, east = self.density.draw(count, generator)
        return {"north": north, "east": east, "heading": self.heading.draw(count, generator)}


class Rings:
    """Several ranges jointly: p(place | all of them) of a uniform prior, by importance sampling.

    Parameters
    ----------
    rings : sequence of Ring
        At least one; their own headings do not matter.
    heading : Heading or Unknown
        What is known of the heading.

    Raises
    ------
    ValueError
        No ring, or one that no place can have.
    """

    def __init__(self, rings: Sequence[Ring], heading: Heading | Unknown | None = None) -> None:
        if not rings:
            raise ValueError("rings: at least one range is needed")
        self._densities = [ring.density for ring in rings]
        self._heading = Unknown() if heading is None else heading

    def draw(self, count: int, generator: np.random.Generator) -> dict[str, Array]:
        """Draw poses.

        Raises
        ------
        ValueError
            No place explains the ranges together, to the digits of float64.
        """
        north, east = draw_jointly(self._densities, count, generator)
        return {"north": north, "east": east, "heading": self._heading.draw(count, generator)}


class Fix:
    """A position fix: a Gaussian.

    Parameters
    ----------
    north, east : float
        Metres.
    covariance : (2, 2) array or float
        Of north and east, m²; one number for the same in all directions.
    heading : Heading or Unknown
        What is known of the heading.

    Raises
    ------
    ValueError
        A covariance that is not finite, symmetric and positive semidefinite.
    """

    def __init__(
        self, north: float, east: float, covariance: ArrayLike, heading: Heading | Unknown | None = None
    ) -> None:
        given = np.asarray(covariance, np.float64)
        matrix = given * np.eye(2) if given.ndim == 0 else given
        if matrix.shape != (2, 2) or not np.isfinite(matrix).all() or not np.array_equal(matrix, matrix.T):
            raise ValueError(
                f"fix: covariance must be finite, symmetric and (2, 2) or one number, got {covariance}"
            )
        values, vectors = np.linalg.eigh(matrix)
        if values[0] < -1e-12 * max(values[1], 0.0) or values[1] < 0.0:
            raise ValueError(
                f"fix: covariance must be positive semidefinite, got eigenvalues {values.tolist()}"
            )
        if not (math.isfinite(north) and math.isfinite(east)):
            raise ValueError(f"fix: the place must be finite, got {north}, {east}")
        self._mean = np.array((north, east))
        self._root = vectors * np.sqrt(np.maximum(values, 0.0))
        self._heading = Unknown() if heading is None else heading

    def draw(self, count: int, generator: np.random.Generator) -> dict[str, Array]:
        """Draw poses."""
        north, east = self._mean[:, None] + self._root @ generator.standard_normal((2, count))
        return {"north": north, "east": east, "heading": self._heading.draw(count, generator)}


class Drawable(Protocol):
    """Anything that points can be drawn from, such as a histogram filter's posterior or a density."""

    def draw(self, count: int, generator: np.random.Generator) -> Array:
        """Draw points, (count, dimension)."""
        ...


class Posterior:
    """Poses from another filter's belief, for example a histogram over the map.

    Parameters
    ----------
    belief : Drawable
        What to draw from.
    names : sequence of str
        What its dimensions are called among the particles' columns.
    heading : Heading or Unknown, optional
        Where to take the heading from; if not given and not among ``names``, it stays as it was.

    Raises
    ------
    ValueError
        No name, one twice, or a heading given twice.
    """

    def __init__(
        self,
        belief: Drawable,
        names: Sequence[str] = ("north", "east"),
        heading: Heading | Unknown | None = None,
    ) -> None:
        if not names or len(set(names)) < len(names):
            raise ValueError(
                f"posterior: dimensions must be named, each once, got {', '.join(names) or 'none'}"
            )
        if heading is not None and "heading" in names:
            raise ValueError("posterior: the heading is a dimension of the belief; give no other")
        self._belief = belief
        self._names = tuple(names)
        self._heading = heading

    def draw(self, count: int, generator: np.random.Generator) -> dict[str, Array]:
        """Draw poses.

        Raises
        ------
        ValueError
            What was drawn does not have the dimensions that were named.
        """
        points = np.asarray(self._belief.draw(count, generator), np.float64)
        if points.shape != (count, len(self._names)):
            raise ValueError(f"posterior: drew {points.shape}, but ({count}, {len(self._names)}) was named")
        columns = {name: points[:, axis].copy() for axis, name in enumerate(self._names)}
        if self._heading is not None:
            columns["heading"] = self._heading.draw(count, generator)
        return columns
