"""How much the ranges of a log scatter, from the log alone: what each reading is worth, whatever it claims.

Radios often claim one round number for every range. A range's errors come from what its echoes make of it, and stay
alike for a second or two of a moving tag; so every beacon's ranges are compared with the straight line from a second
before to a second after, and a robust spread of the differences (1.483 times their median) stands for one independent
error in :data:`ALIKE`: n readings in it are each given √n times as much. A tag that brakes or turns leaves the line,
too, so this is rather too large than too small; of one that stands still it would be too small, so that a claim is
doubted by a factor of two at most.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drivers.sample import Range

ALIKE = 1.5
"""Seconds for which the errors of ranges to one beacon stay alike."""

ASIDE = 1.0
"""Seconds to the two neighbours that a range is compared with: longer, and it is the tag's turns that are seen."""

DOUBT = 0.5
"""The least share of its claim that a reading's sigma may be."""

LEAST_READINGS = 100
"""With fewer differences than this nothing is said."""

_SLACK = 0.2
"""Seconds by which the neighbours may be off."""

_NORMAL = 1.4826
"""Standard deviation of a normal distribution over the median of its magnitude."""


class RangeScatter:
    """The ranges of a log by beacon, and what they claim to be worth."""

    def __init__(self) -> None:
        self._times: dict[int, list[float]] = {}
        self._distances: dict[int, list[float]] = {}
        self._claims: list[float] = []

    def add(self, time: int, reading: Range) -> None:
        """Take one range, of ``time`` (nanoseconds)."""
        self._times.setdefault(reading.beacon, []).append(time / 1e9)
        self._distances.setdefault(reading.beacon, []).append(reading.distance)
        if reading.sigma is not None:
            self._claims.append(reading.sigma)

    def sigma(self) -> float | None:
        """Return the standard deviation that a reading should have, metres, if that is less than it claims."""
        if not self._claims:
            return None
        claim = float(np.median(self._claims))
        found = [self._of(beacon) for beacon in self._times]
        differences = np.concatenate([part for part, _ in found])
        if differences.size < LEAST_READINGS:
            return None
        rate = float(np.median([rate for part, rate in found if part.size]))
        spread = _NORMAL * float(np.median(np.abs(differences)))
        sigma = max(DOUBT * claim, spread * math.sqrt(max(1.0, ALIKE * rate)))
        return round(sigma, 3) if sigma < claim else None

    def _of(self, beacon: int) -> tuple[NDArray[np.float64], float]:
        """Return one beacon's differences, of unit weight, and its readings a second."""
        order = np.argsort(self._times[beacon], kind="stable")
        time = np.array(self._times[beacon])[order]
        distance = np.array(self._distances[beacon])[order]
        last = time.size - 1
        before = np.clip(np.searchsorted(time, time - ASIDE), 0, last)
        after = np.clip(np.searchsorted(time, time + ASIDE), 0, last)
        back, ahead = time - time[before], time[after] - time
        near = (np.abs(back - ASIDE) < _SLACK) & (np.abs(ahead - ASIDE) < _SLACK)
        if not near.any():
            return np.empty(0), 0.0
        back, ahead = back[near], ahead[near]
        share = back / (back + ahead)
        line = (1.0 - share) * distance[before[near]] + share * distance[after[near]]
        weight = np.sqrt(1.0 + (1.0 - share) ** 2 + share**2)
        return (distance[near] - line) / weight, last / (time[-1] - time[0])
