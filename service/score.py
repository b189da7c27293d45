"""How good a run was: its estimates beside the truth.

Errors are horizontal. Coverage counts the ticks whose truth lies in the published 95 % ellipse; for a consistent
filter the normalised estimation error squared (NEES) averages two, its dimension.
"""

from __future__ import annotations

import csv
import math
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

CHI_SQUARE_95 = 5.991464547107979
"""The 95 % quantile of chi-square with two degrees of freedom."""

COLUMNS = ("time_s", "north_m", "east_m", "down_m", "heading_rad")


@dataclass(frozen=True)
class Truth:
    """Where the vehicle really was: Unix seconds, metres north and east, each of shape (n,)."""

    time: NDArray[np.float64]
    north: NDArray[np.float64]
    east: NDArray[np.float64]

    def at(self, times: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return north and east at ``times``, linearly interpolated; NaN outside of what is known."""
        return (
            np.interp(times, self.time, self.north, left=np.nan, right=np.nan),
            np.interp(times, self.time, self.east, left=np.nan, right=np.nan),
        )


def _number(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(text)
    return value


def read_truth(path: Path) -> Truth:
    """Read a truth file: CSV with the columns ``time_s, north_m, east_m`` at least.

    Raises
    ------
    ValueError
        A column is missing, a row is not numbers, or time does not grow; the text says where.
    """
    rows: list[tuple[float, float, float]] = []
    with path.open(newline="") as file:
        reader = csv.DictReader(file)
        missing = [name for name in COLUMNS[:3] if name not in (reader.fieldnames or ())]
        if missing:
            raise ValueError(
                f"{path}: a truth file needs the columns {', '.join(COLUMNS)}; missing: {', '.join(missing)}"
            )
        for row in reader:
            try:
                rows.append((_number(row["time_s"]), _number(row["north_m"]), _number(row["east_m"])))
            except (TypeError, ValueError):
                raise ValueError(
                    f"{path}, line {reader.line_num}: time_s, north_m and east_m must be numbers"
                ) from None
    if len(rows) < 2:
        raise ValueError(f"{path}: a truth file needs at least two rows, has {len(rows)}")
    time, north, east = np.asarray(rows, np.float64).T
    if np.any(np.diff(time) < 0):
        raise ValueError(
            f"{path}: time_s must not run backwards (row {int(np.argmax(np.diff(time) < 0)) + 2})"
        )
    return Truth(time, north, east)


@dataclass(frozen=True)
class Track:
    """The published estimates of one run, a row a tick that had a position.

    ``covariance`` holds nn, ne, ee in its columns, shape (n, 3).
    """

    time: NDArray[np.float64]
    north: NDArray[np.float64]
    east: NDArray[np.float64]
    covariance: NDArray[np.float64]


@dataclass(frozen=True)
class Score:
    """The figures of one run against the truth; ``None`` where there is nothing to compare."""

    rmse_m: float | None
    mean_m: float | None
    p95_m: float | None
    max_m: float | None
    coverage_95: float | None
    nees_mean: float | None
    final_m: float | None

    def rounded(self) -> dict[str, float | None]:
        """Return the figures as a plain object, to a tenth of a millimetre."""
        return {key: None if value is None else round(value, 4) for key, value in asdict(self).items()}


UNSCORED = Score(None, None, None, None, None, None, None)


@dataclass(frozen=True)
class Comparison:
    """A track beside the truth at its own times, a row a tick; NaN where the truth is not known.

    ``error`` is horizontal, metres; ``nees`` its normalised square (two on average).
    """

    error: NDArray[np.float64]
    nees: NDArray[np.float64]


def compare(track: Track, truth: Truth) -> Comparison:
    """Return how far ``track`` is from ``truth``, tick by tick."""
    north, east = truth.at(track.time)
    dn, de = track.north - north, track.east - east
    nn, ne, ee = track.covariance.T
    determinant = np.maximum(nn * ee - ne**2, 1e-12)
    nees: NDArray[np.float64] = (ee * dn**2 - 2 * ne * dn * de + nn * de**2) / determinant
    return Comparison(np.hypot(dn, de), nees)


def score(track: Track, truth: Truth) -> Score:
    """Compare ``track`` with ``truth`` at the track's own times."""
    comparison = compare(track, truth)
    known = np.isfinite(comparison.error)
    if not known.any():
        return UNSCORED
    error, nees = comparison.error[known], comparison.nees[known]
    return Score(
        rmse_m=math.sqrt(float(np.mean(error**2))),
        mean_m=float(error.mean()),
        p95_m=float(np.quantile(error, 0.95)),
        max_m=float(error.max()),
        coverage_95=float(np.mean(nees <= CHI_SQUARE_95)),
        nees_mean=float(nees.mean()),
        final_m=float(error[-1]),
    )
