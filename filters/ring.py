"""Where a range to a beacon says that one is: a ring in the plane, and several of them together.

With a uniform prior over the plane, p(place | range z) is proportional to N(r; z, sigma²), r the distance between
place and beacon. A ring has more room outside than inside, so r itself has the density r N(r; z, sigma²) and not the
Gaussian; that holds for slant distances too, since the plane's area element is r dr dφ of the slant r. It is drawn
exactly by rejection: log r lies under its tangent at m, so N(r; z + sigma² / m, sigma²) lies over it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from filters.resampling import systematic

Array = NDArray[np.float64]

CANDIDATES = 16
"""How many are drawn for each that is kept, where rings are taken together."""

LEAST_CANDIDATES = 4096
"""At least so many in all, or a few draws would all come from a few places."""


class RingDensity:
    """The density of the place, given one range.

    Parameters
    ----------
    north, east, distance, sigma, down : float
        Beacon, range and its standard deviation, and the beacon's depth below the plane; metres.

    Raises
    ------
    ValueError
        A number not finite, a distance that is negative, a sigma that is not positive, or a range shorter than
        ``down`` by more than four sigma, which no place has.
    """

    def __init__(self, north: float, east: float, distance: float, sigma: float, down: float = 0.0) -> None:
        if not all(math.isfinite(number) for number in (north, east, distance, down)):
            raise ValueError(f"ring: finite numbers are needed, got {(north, east, distance, down)}")
        if distance < 0.0 or not 0.0 < sigma < math.inf:
            raise ValueError(
                f"ring: distance must not be negative, sigma positive, got {distance} and {sigma}"
            )
        if distance + 4.0 * sigma < abs(down):
            raise ValueError(
                f"ring: no place lies {distance} m (sigma {sigma} m) from a beacon {abs(down)} m below or above"
            )
        self.centre = np.array((north, east))
        self.distance = distance
        self.sigma = sigma
        self.down = abs(down)
        self.radius = math.sqrt(max(distance * distance - down * down, 0.0))
        self._mode = max(0.5 * (distance + math.sqrt(distance * distance + 4.0 * sigma * sigma)), self.down)

    def draw(self, count: int, generator: np.random.Generator) -> tuple[Array, Array]:
        """Draw places: north and east, (count,) each."""
        slant = self._slants(count, generator)
        radius = np.sqrt(np.maximum(slant * slant - self.down * self.down, 0.0))
        angle = generator.uniform(-math.pi, math.pi, count)
        return self.centre[0] + radius * np.cos(angle), self.centre[1] + radius * np.sin(angle)

    def log_likelihood(self, north: Array, east: Array) -> Array:
        """Return -(r - z)² / 2 sigma², (n,): the log density up to its constant."""
        slant = np.sqrt((north - self.centre[0]) ** 2 + (east - self.centre[1]) ** 2 + self.down * self.down)
        return -0.5 * ((slant - self.distance) / self.sigma) ** 2

    @property
    def log_integral(self) -> float:
        """Logarithm of the likelihood's integral over the plane, 2 π ∫ r exp(-(r - z)² / 2 sigma²) dr from ``down``."""
        z = (self.down - self.distance) / self.sigma
        tail = 0.5 * math.erfc(z / math.sqrt(2.0))
        peak = math.exp(-0.5 * z * z)
        ring = self.sigma * peak + self.distance * math.sqrt(2.0 * math.pi) * tail
        return math.log(2.0 * math.pi * self.sigma * ring)

    def _slants(self, count: int, generator: np.random.Generator) -> Array:
        """Draw slant distances of density r N(r; z, sigma²) above ``down``."""
        kept: list[Array] = []
        missing = count
        while missing > 0:
            m = self._mode
            drawn = generator.normal(self.distance + self.sigma**2 / m, self.sigma, 2 * missing + 16)
            drawn = drawn[drawn > self.down]
            chance = drawn / m * np.exp(1.0 - drawn / m)
            drawn = drawn[generator.random(drawn.size) < chance][:missing]
            kept.append(drawn)
            missing -= drawn.size
        return np.concatenate(kept) if kept else np.zeros(0)


def draw_jointly(
    rings: Sequence[RingDensity], count: int, generator: np.random.Generator
) -> tuple[Array, Array]:
    """Draw places that explain all ranges: candidates, weighed by the product of the rings, and resampled.

    Candidates come half from the rings themselves, half from Gaussians where two rings meet, and are weighed against
    the mixture they came from; so what is kept is right however well the Gaussians fit, if only there are enough
    candidates. Copies of one candidate are possible.

    Returns
    -------
    tuple of two (count,) float64
        North and east, in random order.

    Raises
    ------
    ValueError
        No candidate explains the ranges.
    """
    if len(rings) == 1:
        return rings[0].draw(count, generator)
    total = max(CANDIDATES * count, LEAST_CANDIDATES)
    spots = [spot for pair in combinations(rings, 2) for spot in _meetings(*pair)]
    drawn = [ring.draw(-(-total // (2 * len(rings))), generator) for ring in rings]
    drawn += [_draw_spot(spot, -(-total // (2 * len(spots))), generator) for spot in spots]
    north = np.concatenate([n for n, _ in drawn])
    east = np.concatenate([e for _, e in drawn])
    likelihoods = np.stack([ring.log_likelihood(north, east) for ring in rings])
    constants = np.array([ring.log_integral for ring in rings])
    from_rings = np.logaddexp.reduce(likelihoods - constants[:, None], axis=0) - math.log(len(rings))
    from_spots = np.logaddexp.reduce([_log_spot(s, north, east) for s in spots], axis=0) - math.log(
        len(spots)
    )
    joint = likelihoods.sum(axis=0)
    if joint.max() < -0.5 * 100.0 * len(rings):
        raise ValueError(f"rings: no place explains the {len(rings)} ranges within ten sigma each")
    log_weights = joint - np.logaddexp(from_rings, from_spots)
    chosen = systematic(np.exp(log_weights - log_weights.max()), count, 1.0 - generator.random())
    generator.shuffle(chosen)
    return north[chosen], east[chosen]


Spot = tuple[Array, Array]
"""Mean (2,) and root of the covariance (2, 2)."""


def _meetings(one: RingDensity, other: RingDensity) -> list[Spot]:
    """Where two rings meet, or come nearest: Gaussians there, twice as wide as the rings' own crossing.

    The crossing's information is u uᵀ / sigma² of each ring, u pointing from its beacon. Where the rings touch, it has
    none along them, and the width is that of a touching: the square root of twice sigma times the radius.
    """
    apart = other.centre - one.centre
    distance = float(np.hypot(*apart))
    if distance == 0.0:
        return [(one.centre, np.eye(2) * max(one.radius, one.sigma))]
    along = apart / distance
    across = np.array((-along[1], along[0]))
    foot = (one.radius**2 - other.radius**2 + distance**2) / (2.0 * distance)
    half = math.sqrt(max(one.radius**2 - foot**2, 0.0))
    if half == 0.0:  # the rings do not meet: half-way between them
        near = one.radius if foot >= 0.0 else -one.radius
        far = distance - other.radius if foot <= distance else distance + other.radius
        foot = 0.5 * (near + far)
    spots: list[Spot] = []
    for side in (1.0, -1.0) if half > 0.0 else (1.0,):
        place = one.centre + foot * along + side * half * across
        information = np.zeros((2, 2))
        for ring in (one, other):
            away = (place - ring.centre) / max(float(np.hypot(*(place - ring.centre))), ring.sigma)
            steep = max(ring.radius, ring.sigma) / max(ring.distance, ring.sigma)
            information += np.outer(away, away) * (steep / ring.sigma) ** 2
        touching = 2.0 * max(r.sigma * max(r.distance, r.sigma) for r in (one, other))
        values, vectors = np.linalg.eigh(information + np.eye(2) / touching)
        spots.append((place, vectors * (2.0 / np.sqrt(values))))
    return spots


def _draw_spot(spot: Spot, count: int, generator: np.random.Generator) -> tuple[Array, Array]:
    mean, root = spot
    north, east = mean[:, None] + root @ generator.standard_normal((2, count))
    return north, east


def _log_spot(spot: Spot, north: Array, east: Array) -> Array:
    mean, root = spot
    scaled = np.linalg.solve(root, np.stack([north - mean[0], east - mean[1]]))
    return -0.5 * (scaled * scaled).sum(axis=0) - math.log(2.0 * math.pi * abs(float(np.linalg.det(root))))
