"""A noisy projection of the state on its first coordinate: the sensor of exercises 1, 2, 4 and 5.

z = x + noise,   noise ~ N(0, Q)
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from filters.particle_set import ParticleSet


class ProjectionMeasurement(NamedTuple):
    """A reading of the first coordinate, metres."""

    x: float


class Projection:
    """Gaussian reading of the column ``north``, which the exercises call x.

    Parameters
    ----------
    variance : float
        Q, square metres.

    Raises
    ------
    ValueError
        A variance that is not positive and finite.
    """

    def __init__(self, variance: float) -> None:
        if not 0.0 < variance < math.inf:
            raise ValueError(f"projection: the variance must be positive and finite, got {variance}")
        self.variance = variance

    def refusal(self, measurement: ProjectionMeasurement) -> str | None:
        """Refuse nothing."""
        del measurement
        return None

    def weigh(
        self, particles: ParticleSet, first: int, last: int, measurement: ProjectionMeasurement
    ) -> float:
        """Add the log likelihood; see :class:`filters.sensing.Sensor`."""
        innovation = measurement.x - particles.columns[0, first:last]
        particles.log_weights[first:last] -= innovation**2 / (2.0 * self.variance)
        return -0.5 * math.log(2.0 * math.pi * self.variance)

    def innovation(self, centre: Mapping[str, float], measurement: ProjectionMeasurement) -> float:
        """Measured less expected, metres."""
        return measurement.x - centre["north"]
