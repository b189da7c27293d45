"""How good a run was: its estimates beside the truth.

Errors are horizontal. Coverage counts the ticks whose truth lies in the published ellipse of 50, 95 or 99 %; for a
consistent filter the normalised estimation error squared (NEES) averages two, its dimension. The log score and the
level of a tick are those of the hypotheses that were published (:class:`service.mixture.Mixture`), and of the one
Gaussian where there was one.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.consistency import bounds, independent
from service.mixture import LEAST_VARIANCE, Mixture

CHI_SQUARE_95 = 5.991464547107979
"""The 95 % quantile of chi-square with two degrees of freedom."""

CHI_SQUARE_50, CHI_SQUARE_99 = -2.0 * math.log(0.5), -2.0 * math.log(0.01)
"""The others: with two degrees of freedom they are closed forms."""

LEVELS = 100
"""Bins into which the levels of a run are counted."""

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

    ``covariance`` holds nn, ne, ee in its columns, shape (n, 3); ``mixtures`` the hypotheses of the rows that had
    several.
    """

    time: NDArray[np.float64]
    north: NDArray[np.float64]
    east: NDArray[np.float64]
    covariance: NDArray[np.float64]
    mixtures: Mapping[int, Mixture] = field(default_factory=dict[int, Mixture])


@dataclass(frozen=True)
class Score:
    """The figures of one run against the truth; ``None`` where there is nothing to compare.

    ``nees_low`` and ``nees_high`` bound with 95 % what ``nees_mean`` is of a consistent filter, ``nees_samples`` is how
    many independent ticks the run is worth; ``log_score`` is the mean log density at the truth, nats.
    """

    rmse_m: float | None
    mean_m: float | None
    p95_m: float | None
    max_m: float | None
    coverage_95: float | None
    nees_mean: float | None
    final_m: float | None
    coverage_50: float | None = None
    coverage_99: float | None = None
    nees_low: float | None = None
    nees_high: float | None = None
    nees_samples: float | None = None
    log_score: float | None = None

    def rounded(self) -> dict[str, float | None]:
        """Return the figures as a plain object, to a tenth of a millimetre."""
        return {key: None if value is None else round(value, 4) for key, value in asdict(self).items()}


UNSCORED = Score(None, None, None, None, None, None, None)


@dataclass(frozen=True)
class Comparison:
    """A track beside the truth at its own times, a row a tick; NaN where the truth is not known.

    ``error`` is horizontal, metres; ``nees`` its normalised square (two on average); ``log_score`` the log of the
    published density at the truth, nats; ``level`` the content of the smallest published region that holds it, 0…1.
    """

    error: NDArray[np.float64]
    nees: NDArray[np.float64]
    log_score: NDArray[np.float64]
    level: NDArray[np.float64]


def compare(track: Track, truth: Truth) -> Comparison:
    """Return how far ``track`` is from ``truth``, tick by tick."""
    north, east = truth.at(track.time)
    dn, de = track.north - north, track.east - east
    nn, ne, ee = track.covariance.T
    determinant = np.maximum(nn * ee - ne**2, LEAST_VARIANCE**2)
    nees: NDArray[np.float64] = (ee * dn**2 - 2 * ne * dn * de + nn * de**2) / determinant
    log_score = -math.log(2.0 * math.pi) - 0.5 * np.log(determinant) - 0.5 * nees
    level = -np.expm1(-0.5 * nees)
    for row, mixture in track.mixtures.items():
        if math.isfinite(north[row]):
            log_score[row] = mixture.log_density(np.array([[north[row], east[row]]]))[0]
            level[row] = mixture.level(float(north[row]), float(east[row]))
    return Comparison(np.hypot(dn, de), nees, log_score, level)


def levels(comparison: Comparison) -> list[int]:
    """Return how many ticks have their level in each of :data:`LEVELS` equal bins; nothing without a truth."""
    known = comparison.level[np.isfinite(comparison.level)]
    counts, _ = np.histogram(known, LEVELS, (0.0, 1.0))
    return [int(count) for count in counts] if known.size else []


def score(track: Track, truth: Truth) -> Score:
    """Compare ``track`` with ``truth`` at the track's own times."""
    return figures(compare(track, truth))


def figures(comparison: Comparison) -> Score:
    """Return the figures of what was compared."""
    known = np.isfinite(comparison.error)
    if not known.any():
        return UNSCORED
    error, nees = comparison.error[known], comparison.nees[known]
    samples = independent(nees)
    low, high = bounds(samples)
    return Score(
        rmse_m=math.sqrt(float(np.mean(error**2))),
        mean_m=float(error.mean()),
        p95_m=float(np.quantile(error, 0.95)),
        max_m=float(error.max()),
        coverage_95=float(np.mean(nees <= CHI_SQUARE_95)),
        nees_mean=float(nees.mean()),
        final_m=float(error[-1]),
        coverage_50=float(np.mean(nees <= CHI_SQUARE_50)),
        coverage_99=float(np.mean(nees <= CHI_SQUARE_99)),
        nees_low=low,
        nees_high=high,
        nees_samples=samples,
        log_score=float(comparison.log_score[known].mean()),
    )
