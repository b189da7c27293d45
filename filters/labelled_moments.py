"""Weight, mean and covariance of each label's particles, displaced, in one pass over all of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from filters.belief import Displacement
from filters.kernels import labelled as kernels
from filters.kernels.compile import Float32Array, Int32Array

Array = NDArray[np.float64]

POSE = 3
FAR = 0.5
"""Radians of the mean heading from where it was looked for, above which it is looked for again."""
_FLAT = 1e-9
"""Least variance relative to the pose's: particles that are all alike have no density to compare."""


class Hypothesis(NamedTuple):
    """One of several places that a belief holds.

    Attributes
    ----------
    name : int
        Which one; the same over time.
    weight : float
        Its share of the belief.
    mean : (dimension,) float64
        North, east, heading in [-pi, pi), and the columns beside them.
    covariance : (3, 3) float64
        Of its own particles' north, east and heading, about its own mean.
    variance : (dimension,) float64
        Of each column; the first three are the diagonal of ``covariance``.
    """

    name: int
    weight: float
    mean: Array
    covariance: Array
    variance: Array

    def distance(self, other: Hypothesis) -> float:
        """Return the Bhattacharyya distance of the two poses as Gaussians: 0 if they are alike.

        Bhattacharyya, "On a measure of divergence between two statistical populations", Bull. Calcutta Math. Soc. 35,
        1943: Δᵀ C⁻¹ Δ / 8 + ½ log(|C| / √(|A| |B|)), with C the mean of A and B.
        """
        away = self.mean[:POSE] - other.mean[:POSE]
        away[2] = math.remainder(float(away[2]), 2.0 * math.pi)
        least = np.diag(_FLAT * (np.diag(self.covariance) + np.diag(other.covariance)) + 1e-12)
        one, two = self.covariance + least, other.covariance + least
        middle = 0.5 * (one + two)
        logs = [float(np.linalg.slogdet(matrix)[1]) for matrix in (middle, one, two)]
        square = float(away @ np.linalg.solve(middle, away))
        return square / 8.0 + 0.5 * (logs[0] - 0.5 * (logs[1] + logs[2]))


class LabelledMoments:
    """The sums, in memory allocated once.

    Parameters
    ----------
    dimension : int
        How many columns there are, at least three.
    most : int
        How many labels there can be.
    """

    def __init__(self, dimension: int, most: int) -> None:
        self._references = np.zeros((most, dimension))
        self._masses = np.zeros(most)
        self._sums = np.zeros((most, kernels.POSE_SUMS + 2 * (dimension - POSE)))

    def inherit(self, old: int, new: int) -> None:
        """Take the means of one label as where to look for another's; a heading wraps on the far side of them."""
        self._references[new] = self._references[old]

    def of(
        self,
        columns: Float32Array,
        weights: Float32Array,
        labels: Int32Array,
        count: int,
        displacement: Displacement,
        names: Mapping[int, int],
    ) -> dict[int, Hypothesis]:
        """Return the hypothesis of each label that has a name and weight.

        The sums are taken about each label's mean as the last call found it; where that was far off, they are taken
        once more.
        """
        found = self._taken(columns, weights, labels, count, displacement, names)
        if any(self._far(label) for label in found):
            self._refer(found)
            found = self._taken(columns, weights, labels, count, displacement, names)
        self._refer(found)
        return found

    def _taken(
        self,
        columns: Float32Array,
        weights: Float32Array,
        labels: Int32Array,
        count: int,
        displacement: Displacement,
        names: Mapping[int, int],
    ) -> dict[int, Hypothesis]:
        asked = np.array(sorted(names), np.int64)
        kernels.moments.direct(
            columns, weights, labels, count, asked, *displacement, self._references, self._sums
        )
        kernels.masses.direct(weights, labels, count, self._masses)
        total = float(self._masses.sum())
        return {
            label: self._one(label, name, total)
            for label, name in names.items()
            if self._sums[label, 0] > 0.0
        }

    def _far(self, label: int) -> bool:
        """Whether the reference was too far from the mean: its heading, or its place in terms of the spread."""
        sums = self._sums[label]
        n, e = sums[1:3] / sums[0]
        square = float((sums[6] + sums[8]) / sums[0])
        return abs(self._offset(label)) > FAR or n * n + e * e > 0.99 * square

    def _offset(self, label: int) -> float:
        return math.atan2(self._sums[label, 4], self._sums[label, 5])

    def _refer(self, found: Mapping[int, Hypothesis]) -> None:
        for label, hypothesis in found.items():
            self._references[label] = hypothesis.mean

    def _one(self, label: int, name: int, total: float) -> Hypothesis:
        sums, about = self._sums[label], self._references[label]
        weight = float(sums[0])
        n, e, h = sums[1:4] / weight
        offset = self._offset(label)
        nn, ne, ee, nh, eh, hh = sums[6:12] / weight
        covariance = np.array(
            [
                [nn - n * n, ne - n * e, nh - n * h],
                [ne - n * e, ee - e * e, eh - e * h],
                [nh - n * h, eh - e * h, max(hh - 2.0 * offset * h + offset * offset, 0.0)],
            ]
        )
        beside = sums[kernels.POSE_SUMS :].reshape(-1, 2) / weight
        mean = about + np.concatenate([(n, e, offset), beside[:, 0]])
        mean[2] = math.remainder(float(mean[2]), 2.0 * math.pi)
        variance = np.concatenate([np.diag(covariance), beside[:, 1] - beside[:, 0] ** 2])
        return Hypothesis(name, weight / total, mean, covariance, np.maximum(variance, 0.0))
