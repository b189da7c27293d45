"""A scan as sectors: in each direction, how far the nearest thing in it is.

A laser gives many narrow sectors, a ring of sonars a few wide ones, and MAVLink's OBSTACLE_DISTANCE whatever
its sender made of either.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, slots=True, eq=False)
class RangeSectors:
    """Distances to the nearest thing in each of several sectors, in the body's frame.

    A range from ``shortest`` to ``longest`` is a hit. One beyond ``longest``, infinity included, says that the
    sector is clear up to ``longest``. One below ``shortest``, and NaN, say nothing.

    Attributes
    ----------
    bearings : (n,) float64
        Middle of each sector, radians clockwise from forward.
    ranges : (n,) float64
        Metres.
    widths : (n,) float64
        Angle that each sector covers, radians; 0 for a single ray.
    shortest, longest : float
        What the sensor can measure, metres.

    Raises
    ------
    ValueError
        Shapes that differ, a bearing or width that is not finite, a width outside [0, 2π], a negative range,
        or limits out of order.
    """

    bearings: NDArray[np.float64]
    ranges: NDArray[np.float64]
    widths: NDArray[np.float64]
    shortest: float
    longest: float

    def __post_init__(self) -> None:
        if not self.bearings.shape == self.ranges.shape == self.widths.shape or self.ranges.ndim != 1:
            raise ValueError(
                f"scan: bearings, ranges and widths must be of one length, got {self.bearings.shape}, "
                f"{self.ranges.shape} and {self.widths.shape}"
            )
        if not np.isfinite(self.bearings).all():
            raise ValueError("scan: bearings must be finite")
        if not ((self.widths >= 0.0) & (self.widths <= 2.0 * math.pi)).all():
            raise ValueError("scan: widths must lie in 0 to 2 pi radians")
        if (self.ranges < 0.0).any():
            raise ValueError(f"scan: ranges must not be negative, got {np.nanmin(self.ranges)} m")
        if not 0.0 <= self.shortest < self.longest < math.inf:
            raise ValueError(
                f"scan: 0 <= shortest < longest is needed, got {self.shortest} m and {self.longest} m"
            )

    @classmethod
    def of(
        cls,
        bearings: ArrayLike,
        ranges: ArrayLike,
        longest: float,
        *,
        width: ArrayLike = 0.0,
        shortest: float = 0.0,
    ) -> RangeSectors:
        """Make a scan of whatever numpy takes for arrays; one width serves all sectors.

        Raises
        ------
        ValueError
            As for the class.
        """
        measured = np.array(ranges, np.float64, ndmin=1)
        try:
            widths = np.array(np.broadcast_to(np.asarray(width, np.float64), measured.shape))
        except ValueError:
            raise ValueError(
                f"scan: width must be one number or {measured.size} of them, got shape {np.shape(width)}"
            ) from None
        return cls(np.array(bearings, np.float64, ndmin=1), measured, widths, shortest, longest)

    @property
    def hits(self) -> NDArray[np.bool_]:
        """Which sectors measured something, (n,) bool."""
        return (self.ranges >= self.shortest) & (self.ranges <= self.longest)

    @property
    def clear(self) -> NDArray[np.bool_]:
        """Which sectors saw nothing up to ``longest``, (n,) bool."""
        return self.ranges > self.longest
