"""The belief's particles, and densities extracted from them."""

from __future__ import annotations

import msgspec


class Cloud(msgspec.Struct, frozen=True, gc=False):
    """The attachment of ``particles``.

    Attributes
    ----------
    count : int
        How many rows.
    time : float
        Of validity, Unix seconds.
    columns : tuple[str, str, str, str]
        What stands in each row, in this order.
    """

    count: int
    time: float
    columns: tuple[str, str, str, str] = ("north", "east", "heading", "weight")


class Component(msgspec.Struct, frozen=True, gc=False):
    """One Gaussian of a mixture.

    Attributes
    ----------
    weight : float
        They sum to one.
    mean : list[float]
        Of the density's columns.
    covariance : list[list[float]]
        Its own.
    """

    weight: float
    mean: list[float]
    covariance: list[list[float]]


class Cell(msgspec.Struct, frozen=True, gc=False):
    """A box and the probability in it.

    Attributes
    ----------
    north, east : tuple[float, float]
        From and to, m.
    mass : float
        Over its area, the density in it.
    """

    north: tuple[float, float]
    east: tuple[float, float]
    mass: float


class Density(msgspec.Struct, frozen=True, gc=False):
    """The answer to ``@rpc/density``: a density of the last cloud of particles.

    Attributes
    ----------
    extractor : str
        ``gaussian``, ``kmeans``, ``histogram``, ``tree`` or ``kernel``.
    time : float
        Of the cloud, Unix seconds.
    particles : int
        Of how many.
    columns : list[str]
        The density's dimensions: north, east and heading, or north and east.
    mean, covariance : list[float], list[list[float]]
        Of the density, in their order; m and rad.
    components : list[Component] or None
        Of ``kmeans``: the mixture.
    cells : list[Cell] or None
        Of ``histogram`` and ``tree`` all that hold anything; of ``kernel`` a grid, its density at their middles.
    bandwidth : list[float] or None
        Of ``kernel``: north and east, m.
    """

    extractor: str
    time: float
    particles: int
    columns: list[str]
    mean: list[float]
    covariance: list[list[float]]
    components: list[Component] | None = None
    cells: list[Cell] | None = None
    bandwidth: list[float] | None = None
