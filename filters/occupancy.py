"""The occupancy grid: a binary Bayes filter (Table 4.2) for every cell of a map.

Each cell is occupied or free, does not change, and is believed independently of the others; a scan from a
known pose updates the cells that it says something about. The inverse sensor model (that of Table 9.2 of
*Probabilistic Robotics*, whose cells are found here by casting rays) says of a sector with a hit at distance
z: free up to z - thickness / 2, occupied from there to z + thickness / 2, and nothing of what lies behind.

However many rays of a scan pass through a cell, one scan is one measurement of it: near the sensor, where the
rays crowd, counting each would make a cell certain after a single scan. In a cell where one ray ends and
another passes, the end counts (as in OctoMap, Hornung et al. 2013).

The hit of a wide sector may lie anywhere on its arc, and the whole arc is marked; what was marked wrongly is
cleared by later scans from elsewhere, whose rays pass there.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from filters.binary import BinaryBayesFilter, log_odds
from filters.geometry import GridGeometry
from filters.kernels import raycast
from filters.sectors import RangeSectors

Array = NDArray[np.float64]

OCCUPIED = 0.5
"""A cell more likely occupied than this stops the rays of expected ranges."""

MOST_RAYS = 4096
"""Of a sector. One so wide and so long that its rays part by more than a cell has its end far from any map."""


class InverseRangeModel:
    """p(occupied | z) of the cells of a sector.

    Parameters
    ----------
    occupied : float
        Of a cell in which the hit may lie; above one half, below 1.
    free : float
        Of a cell that the sensor saw through; above 0, below one half.
    thickness : float
        Depth of the obstacle that a hit stands for, metres: about twice the sensor's standard deviation, and
        not less than the map's resolution where walls must not have holes.

    Raises
    ------
    ValueError
        A parameter out of its range.
    """

    def __init__(self, occupied: float = 0.7, free: float = 0.35, thickness: float = 0.1) -> None:
        if not 0.0 < free < 0.5 < occupied < 1.0:
            raise ValueError(
                f"inverse range model: 0 < free < 0.5 < occupied < 1 is needed, got free {free}, "
                f"occupied {occupied}"
            )
        if not 0.0 <= thickness < math.inf:
            raise ValueError(
                f"inverse range model: thickness must be finite and not negative, got {thickness} m"
            )
        self.occupied = occupied
        self.free = free
        self.thickness = thickness


class Pose(NamedTuple):
    """Where the sensor is: metres, and radians clockwise from north."""

    north: float
    east: float
    heading: float


class OccupancyGrid:
    """A map as a belief: how likely each cell is occupied.

    Parameters
    ----------
    geometry : GridGeometry
        Where the cells lie.
    prior : array
        p(occupied) before any measurement, inside (0, 1); one number, or one for each cell.
    limit : float
        Largest magnitude of a cell's log odds: how many scans it takes to see that a door was opened. 6 is
        p = 0.9975; infinity for none.

    Raises
    ------
    ValueError
        As :class:`filters.binary.BinaryBayesFilter`.
    """

    def __init__(self, geometry: GridGeometry, prior: ArrayLike = 0.5, limit: float = 6.0) -> None:
        self.geometry = geometry
        self.cells = BinaryBayesFilter(prior, geometry.shape, limit)
        """The filter of every cell, [row, column]."""
        self._marks = np.zeros(geometry.shape, np.uint8)

    @classmethod
    def from_probability(
        cls, resolution: float, north: float, east: float, occupancy: ArrayLike, limit: float = 6.0
    ) -> OccupancyGrid:
        """Make a grid of a map that is known: its probabilities are the belief to start from.

        Parameters
        ----------
        resolution, north, east : float
            As :class:`filters.geometry.GridGeometry`.
        occupancy : (rows, columns) array
            p(occupied) of each cell; NaN where it is not known.
        limit : float
            Within which certain cells are kept.

        Raises
        ------
        ValueError
            Not two dimensions, a probability outside [0, 1], or a geometry that makes no sense.
        """
        given = np.asarray(occupancy, np.float64)
        if given.ndim != 2:
            raise ValueError(f"occupancy grid: a map has two dimensions, got shape {given.shape}")
        if ((given < 0.0) | (given > 1.0)).any():
            raise ValueError("occupancy grid: probabilities must lie in [0, 1], or be NaN where unknown")
        grid = cls(GridGeometry(resolution, north, east, *given.shape), limit=limit)
        known = np.where(np.isnan(given), 0.5, given)
        grid.cells.log_odds[...] = np.clip(log_odds(known), -limit, limit)
        return grid

    @property
    def occupancy(self) -> Array:
        """p(occupied) of every cell, (rows, columns) float64."""
        return self.cells.belief

    def blocked(self, threshold: float = OCCUPIED) -> NDArray[np.bool_]:
        """Which cells are more likely occupied than a threshold, (rows, columns) bool."""
        return self.cells.log_odds > log_odds(threshold)

    def integrate(self, pose: Pose, scan: RangeSectors, model: InverseRangeModel) -> None:
        """Line 2 of Table 4.2 for every cell that a scan says something about.

        Raises
        ------
        ValueError
            A pose that is not finite; the map is unchanged then.
        """
        _require_finite(np.array(pose, np.float64))
        resolution = self.geometry.resolution
        hits = scan.hits
        used = hits | scan.clear
        half = 0.5 * model.thickness
        reach = np.where(hits, scan.ranges, scan.longest)[used]
        free = np.where(hits[used], np.maximum(reach - half, 0.0), reach) / resolution
        ends = np.where(hits[used], (reach + half) / resolution, -1.0)
        bearings, sector = _fan(scan.bearings[used], scan.widths[used], (reach + half) / resolution)
        row, column = self.geometry.cells(pose.north, pose.east)
        angle = pose.heading + bearings
        directions = np.stack((np.cos(angle), np.sin(angle)), axis=1)
        raycast.mark(self._marks, float(row), float(column), directions, free[sector], ends[sector])
        reached = float(np.max(np.maximum(free, ends), initial=0.0))
        self._settle(float(row), float(column), reached, model)

    def expected_ranges(
        self,
        poses: ArrayLike,
        bearings: ArrayLike,
        longest: float,
        *,
        width: float = 0.0,
        threshold: float = OCCUPIED,
    ) -> Array:
        """What a scan would measure: distance to the nearest blocked cell in each sector.

        Parameters
        ----------
        poses : (..., 3) array
            North and east, metres, and heading, radians, of the sensor.
        bearings : (n,) array
            Middle of each sector, radians clockwise from forward.
        longest : float
            Farthest that the sensor sees, metres.
        width : float
            Angle of a sector, radians; the nearest cell in it counts. 0 for a single ray.
        threshold : float
            From which probability a cell is blocked.

        Returns
        -------
        (..., n) float64
            Metres to where the ray enters the cell; infinity where nothing is within ``longest``. 0 from
            inside a blocked cell.

        Raises
        ------
        ValueError
            A pose, bearing, width or length that is not finite.
        """
        where = np.asarray(poses, np.float64)
        middle = np.array(bearings, np.float64, ndmin=1)
        _require_finite(where, middle, np.array((longest, width)))
        if where.shape[-1:] != (3,):
            raise ValueError(f"expected ranges: a pose has 3 numbers, got shape {where.shape}")
        reach = longest / self.geometry.resolution
        fan, sector = _fan(middle, np.full(middle.shape, width), np.full(middle.shape, reach))
        angle = where[..., 2, None] + fan
        row, column = self.geometry.cells(where[..., 0, None], where[..., 1, None])
        lengths = np.empty(angle.size)
        raycast.cast(
            np.ascontiguousarray(self.blocked(threshold)).view(np.uint8),
            np.broadcast_to(row, angle.shape).flatten(),
            np.broadcast_to(column, angle.shape).flatten(),
            np.cos(angle).ravel(),
            np.sin(angle).ravel(),
            reach,
            lengths,
        )
        if middle.size == 0:
            return np.empty((*angle.shape[:-1], 0))
        starts = np.searchsorted(sector, np.arange(middle.size))
        nearest: Array = np.minimum.reduceat(lengths.reshape(angle.shape), starts, axis=-1)
        return nearest * self.geometry.resolution

    def _settle(self, row: float, column: float, reach: float, model: InverseRangeModel) -> None:
        """Add up the marks in the square that the scan can have reached."""
        rows, columns = self.geometry.shape
        top = (max(0, math.floor(row - reach)), min(rows, math.ceil(row + reach) + 1))
        side = (max(0, math.floor(column - reach)), min(columns, math.ceil(column + reach) + 1))
        raycast.settle(
            self.cells.log_odds,
            self.cells.prior,
            self._marks,
            *top,
            *side,
            float(log_odds(model.free)),
            float(log_odds(model.occupied)),
            self.cells.limit,
        )


def _fan(bearings: Array, widths: Array, reach: Array) -> tuple[Array, NDArray[np.intp]]:
    """Split each sector into rays not farther apart than a cell at its end; also the sector of each ray."""
    counts = np.clip(np.ceil(widths * reach), 1, MOST_RAYS).astype(np.intp)
    sector = np.repeat(np.arange(bearings.size), counts)
    place = np.arange(sector.size) - np.repeat(np.cumsum(counts) - counts, counts)
    return bearings[sector] + widths[sector] * ((place + 0.5) / counts[sector] - 0.5), sector


def _require_finite(*arrays: Array) -> None:
    for array in arrays:
        if not np.isfinite(array).all():
            raise ValueError(f"occupancy grid: every number must be finite, got {array.tolist()}")
