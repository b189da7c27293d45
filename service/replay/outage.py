"""How a belief fared while a sensor was taken away: where it was at the end, and whether it knew how far off."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from filters.density.gaussian import radius
from service.replay.blanking import Blank
from service.score import CHI_SQUARE_95, Track, Truth, compare


class Outage(NamedTuple):
    """What became of one blanking, by the truth.

    Attributes
    ----------
    what : str
        Which it was, in the user's words.
    error_m : float
        Horizontal, of the last estimate before the sensor came back, metres.
    radius_m : float
        That claimed to hold the truth with 95 % then, metres.
    distance_m : float
        The way, by the truth, since the sensor went away.
    share : float or None
        Error over distance; ``None`` for a vehicle that did not move.
    coverage_95 : float
        Share of the estimates meanwhile whose truth lay in the 95 % region.
    """

    what: str
    error_m: float
    radius_m: float
    distance_m: float
    share: float | None
    coverage_95: float

    def rounded(self) -> dict[str, str | float | None]:
        """Return the figures as a plain object, to a tenth of a millimetre."""
        figures = self._asdict()
        return {name: round(v, 4) if isinstance(v, float) else v for name, v in figures.items()}


def outages_of(track: Track, truth: Truth | None, blanks: Sequence[Blank], begin: float) -> list[Outage]:
    """Return what became of every blanking that the truth covers.

    Parameters
    ----------
    track : Track
        What was published.
    begin : float
        Unix seconds from which the blankings count.
    """
    if truth is None or not track.time.size:
        return []
    compared = compare(track, truth)
    found: list[Outage] = []
    for blank in blanks:
        meanwhile = (track.time >= begin + blank.first) & (track.time < begin + blank.last)
        rows = np.flatnonzero(meanwhile & np.isfinite(compared.error))
        if not rows.size:
            continue
        first, last = int(rows[0]), int(rows[-1])
        nn, ne, ee = track.covariance[last].tolist()
        error = float(compared.error[last])
        distance = driven(truth, float(track.time[first]), float(track.time[last]))
        found.append(
            Outage(
                blank.words,
                error,
                radius(np.array([[nn, ne], [ne, ee]]), 0.95),
                distance,
                error / distance if distance > 0.0 else None,
                float(np.mean(compared.nees[rows] <= CHI_SQUARE_95)),
            )
        )
    return found


def driven(truth: Truth, start: float, end: float) -> float:
    """Return the length of the way between two times, metres."""
    inside = truth.time[(truth.time > start) & (truth.time < end)]
    north, east = truth.at(np.concatenate([[start], inside, [end]]))
    return float(np.hypot(np.diff(north), np.diff(east)).sum())
