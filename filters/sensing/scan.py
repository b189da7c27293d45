"""Scan: the ends of a scan's rays should lie on what the map says is there.

A likelihood field (section 6.4 of *Probabilistic Robotics*): of every cell the distance to the nearest
occupied one is computed once, and a particle is weighed by looking up where the ends of the rays come to lie.

    p(z | x) = product over the hits of  (1 - outliers) N(d; 0, sigma²) + outliers / span

with d the distance at a hit's end. A ray's way is not followed: a wall that it should not have passed costs
nothing. Sectors without a hit say nothing here. The likelihood is smooth in the pose, and as cheap as a table.

What lies beyond the map, and what is farther from every obstacle than ``farthest``, can only be an outlier: a
particle outside the map is not better off than one whose rays end in the open. Unknown cells are not
occupied; a map in which much is unknown needs a larger share of outliers.

The rays of a scan are not independent (one pillar that was moved spoils ten of them, and the map's own errors
them all), and the product above is far too sure of itself; ``trust`` is the power that each ray's likelihood
is raised to.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy import float32, int32
from numpy.typing import ArrayLike, NDArray

from filters.geometry import GridGeometry
from filters.kernels.compile import Float32Array, kernel
from filters.kernels.elementary import log_mixture, sincos
from filters.particle_set import ParticleSet
from filters.sectors import RangeSectors
from filters.sensing.robust import check, mixture

_LOG_SQRT_TWO_PI = 0.5 * math.log(2.0 * math.pi)
_FIELDS = 3
_CHUNK = 1024


class ScanMeasurement(tuple[float, ...]):
    """The hits of a scan: for each one forward, right, and lateral uncertainty, metres, in a row.

    The uncertainty is the standard deviation of a hit that lies anywhere on its sector's arc.
    """

    __slots__ = ()

    @classmethod
    def of(cls, sectors: RangeSectors, every: int = 1) -> ScanMeasurement:
        """Take every n-th sector's hit; the ones without a hit are left out.

        Raises
        ------
        ValueError
            ``every`` is below 1.
        """
        if every < 1:
            raise ValueError(f"scan: every must be at least 1, got {every}")
        used = np.flatnonzero(sectors.hits[::every]) * every
        distance, bearing = sectors.ranges[used], sectors.bearings[used]
        lateral = distance * sectors.widths[used] / math.sqrt(12.0)
        ends = np.stack((distance * np.cos(bearing), distance * np.sin(bearing), lateral), axis=1)
        return cls(ends.ravel().tolist())


class Scan:
    """Likelihood field over a map, with an outlier part for each ray.

    Parameters
    ----------
    geometry : GridGeometry
        Where the map's cells lie.
    occupied : (rows, columns) array of bool
        Which of them hold an obstacle; at least one.
    sigma : float
        Standard deviation of a hit's distance from the obstacle, metres: the sensor's and the map's together;
        not less than half the resolution, for the field knows no distance finer than a cell.
    outliers : float
        Fraction of the hits that say nothing.
    span : float
        How widely outliers scatter, metres: the longest range.
    trust : float
        Power of each ray's likelihood, in (0, 1].
    lever : (float, float)
        Where the sensor sits, forward and right of the vehicle's origin, metres.
    farthest : float
        Distance, metres, from which the field is not followed.

    Raises
    ------
    ValueError
        A parameter out of its range, a map without an obstacle, or shapes that differ.
    ModuleNotFoundError
        scipy is not installed: it comes with the extra ``maps``.
    """

    def __init__(
        self,
        geometry: GridGeometry,
        occupied: ArrayLike,
        sigma: float,
        outliers: float = 0.2,
        span: float = 50.0,
        trust: float = 1.0,
        lever: tuple[float, float] = (0.0, 0.0),
        farthest: float = 10.0,
    ) -> None:
        check("scan", sigma, outliers, span)
        if not 0.0 < trust <= 1.0:
            raise ValueError(f"scan: trust must lie in (0, 1], got {trust}")
        if not all(map(math.isfinite, lever)):
            raise ValueError(f"scan: lever must be two finite numbers, got {lever}")
        self.sigma = sigma
        self.outliers = outliers
        self.span = span
        self.trust = trust
        self.lever = lever
        self.geometry = geometry
        self.field: Float32Array = distance_field(geometry, occupied, farthest)
        """Distance to the nearest obstacle, metres, with a border of one cell: (rows + 2, columns + 2)."""

    def refusal(self, measurement: ScanMeasurement) -> str | None:
        """Refuse a scan without a hit, and one that is not made of whole hits."""
        if len(measurement) == 0:
            return "a scan needs at least one hit"
        if len(measurement) % _FIELDS:
            return f"a scan has {_FIELDS} numbers for each hit, got {len(measurement)}"
        if min(measurement[2::_FIELDS]) < 0.0:
            return f"a hit's uncertainty must not be negative, got {min(measurement[2::_FIELDS]):g}"
        return None

    def weigh(self, particles: ParticleSet, first: int, last: int, measurement: ScanMeasurement) -> float:
        """Add the log likelihood of all hits; see :class:`filters.sensing.Sensor`."""
        hits, constant = self._hits(measurement)
        ends(
            particles.columns,
            particles.log_weights,
            first,
            last,
            self.field,
            self.geometry.north - self.geometry.resolution,
            self.geometry.east - self.geometry.resolution,
            1.0 / self.geometry.resolution,
            hits,
            self.trust,
        )
        return constant

    def innovation(self, centre: Mapping[str, float], measurement: ScanMeasurement) -> float:
        """Root mean square distance of the hits from obstacles at the centre, metres; never negative."""
        hits = np.array(measurement).reshape(-1, _FIELDS)
        forward, right = hits[:, 0] + self.lever[0], hits[:, 1] + self.lever[1]
        cosine, sine = math.cos(centre["heading"]), math.sin(centre["heading"])
        row, column = self.geometry.cells(
            centre["north"] + forward * cosine - right * sine,
            centre["east"] + forward * sine + right * cosine,
        )
        rows, columns = self.geometry.shape
        inner = np.clip(np.floor(row) + 1, 0, rows + 1).astype(int)
        across = np.clip(np.floor(column) + 1, 0, columns + 1).astype(int)
        return float(np.sqrt(np.mean(np.square(self.field[inner, across].astype(np.float64)))))

    def _hits(self, measurement: ScanMeasurement) -> tuple[Float32Array, float]:
        """Forward, right, gain and the mixture's two logarithms for each hit; and the constant of all."""
        given = np.array(measurement, np.float64).reshape(-1, _FIELDS)
        hits = np.empty((len(given), 5), np.float32)
        constant = 0.0
        for hit, (forward, right, lateral) in zip(hits, given.tolist(), strict=True):
            sigma = math.hypot(self.sigma, lateral)
            mixed = mixture(self.outliers, -math.log(sigma) - _LOG_SQRT_TWO_PI, -math.log(self.span))
            gain = math.sqrt(0.5) / sigma
            hit[:] = forward + self.lever[0], right + self.lever[1], gain, mixed.log_inlier, mixed.log_outlier
            constant += mixed.log_peak
        return hits, self.trust * constant


def distance_field(geometry: GridGeometry, occupied: ArrayLike, farthest: float) -> Float32Array:
    """Distance from each cell's middle to that of the nearest occupied one, at most ``farthest``.

    Returns
    -------
    (rows + 2, columns + 2) float32
        Metres; the border of one cell, which stands for all that is beyond the map, is so far that only an
        outlier reaches it.

    Raises
    ------
    ValueError
        No occupied cell, a shape other than the geometry's, or ``farthest`` not positive and finite.
    ModuleNotFoundError
        scipy is not installed.
    """
    obstacles: NDArray[np.bool_] = np.asarray(occupied, np.bool_)
    if obstacles.shape != geometry.shape:
        raise ValueError(f"scan: the map must have the shape {geometry.shape}, got {obstacles.shape}")
    if not obstacles.any():
        raise ValueError("scan: the map has no occupied cell, so nothing could be measured")
    if not 0.0 < farthest < math.inf:
        raise ValueError(f"scan: farthest must be positive and finite, got {farthest} m")
    try:
        ndimage: Any = importlib.import_module("scipy.ndimage")
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            "a scan is matched to a map by scipy's distance transform: pip install 'beliefd[maps]'"
        ) from error
    distance: NDArray[np.float64] = ndimage.distance_transform_edt(~obstacles) * geometry.resolution
    distance[distance >= farthest] = _NOWHERE
    return np.pad(distance, 1, constant_values=_NOWHERE).astype(np.float32)


_NOWHERE = 1e9
"""Metres: so far from every obstacle that the Gaussian part is nothing."""


@kernel(
    "void(float32[:, ::1], float32[::1], int64, int64, float32[:, ::1], float32, float32, float32,"
    "float32[:, ::1], float32)"
)
def ends(
    columns: Float32Array,
    log_weights: Float32Array,
    first: int,
    last: int,
    field: Float32Array,
    corner_north: float,
    corner_east: float,
    per_metre: float,
    hits: Float32Array,
    trust: float,
) -> None:
    """Look up the field at the end of every hit; a NaN or a place beyond the map falls on the border.

    By chunks that stay in the first-level cache, and in three loops: the look-up, which no compiler can prove to
    be harmless, stands alone so that the arithmetic before and after it runs in vector registers.
    """
    stride = int32(field.shape[1])
    flat = field.ravel()
    top = float32(field.shape[0] - 1)
    side = float32(field.shape[1] - 1)
    zero = float32(0.0)
    sines, cosines = np.empty(_CHUNK, float32), np.empty(_CHUNK, float32)
    places, distances = np.empty(_CHUNK, int32), np.empty(_CHUNK, float32)
    for start in range(first, last, _CHUNK):
        stop = min(start + _CHUNK, last)
        north = columns[0, start:stop]
        east = columns[1, start:stop]
        heading = columns[2, start:stop]
        log_weight = log_weights[start:stop]
        for i in range(stop - start):
            sines[i], cosines[i] = sincos(heading[i])
        for k in range(hits.shape[0]):
            forward, right, gain = hits[k, 0], hits[k, 1], hits[k, 2]
            log_inlier, log_outlier = hits[k, 3], hits[k, 4]
            for i in range(stop - start):
                n = float32(north[i] - corner_north + forward * cosines[i] - right * sines[i])
                e = float32(east[i] - corner_east + forward * sines[i] + right * cosines[i])
                row = float32(n * per_metre)
                column = float32(e * per_metre)
                row = row if row > zero else zero
                column = column if column > zero else zero
                row = row if row < top else top
                column = column if column < side else side
                places[i] = int32(int32(row) * stride + int32(column))
            for i in range(stop - start):
                distances[i] = flat[np.uint32(places[i])]
            for i in range(stop - start):
                q = float32(gain * distances[i])
                log_weight[i] += trust * log_mixture(float32(q * q), log_inlier, log_outlier)
