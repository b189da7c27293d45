"""What every belief can say, in values that belong to no particular filter.

A belief about a vehicle is a distribution over its pose (north, east, heading) and over slow states beside
it. The daemon asks it for moments, displaced from the delayed horizon to now.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray


class Displacement(NamedTuple):
    """A rigid motion in the body's own frame: metres forward and right, then radians clockwise."""

    forward: float
    right: float
    turn: float


STILL = Displacement(0.0, 0.0, 0.0)


class Moments(NamedTuple):
    """First and second moments of a belief.

    Attributes
    ----------
    names : tuple of str
        The state's dimensions, north, east and heading first.
    mean : (dimension,) float64
        Weighted mean; that of the heading is circular, in [-pi, pi).
    pose_covariance : (3, 3) float64
        Of north, east and heading about the mean, with the differences of headings wrapped.
    variance : (dimension,) float64
        Of each dimension; the first three are the diagonal of ``pose_covariance``.
    effective_sample_size : float
        One over the sum of the squared normalised weights: how many equally weighted particles it is worth.
    """

    names: tuple[str, ...]
    mean: NDArray[np.float64]
    pose_covariance: NDArray[np.float64]
    variance: NDArray[np.float64]
    effective_sample_size: float


class Joint(NamedTuple):
    """Mean, (k,) float64, and covariance, (k, k) float64, of some of a belief's dimensions, in the order of names."""

    names: tuple[str, ...]
    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]


class Evidence(NamedTuple):
    """What a measurement said about the belief.

    Attributes
    ----------
    log_mean : float
        Logarithm of the weighted mean likelihood under the weights before this measurement, with its
        constants: a log density in the measurement's unit. Minus infinity if no particle can explain it; NaN
        if not accepted.
    innovation : float
        Measured minus expected at the belief's centre.
    accepted : bool
        False if the measurement failed the sensor's validity test; the weights are then untouched.
    """

    log_mean: float
    innovation: float
    accepted: bool


class Belief(Protocol):
    """The named requirement of a belief."""

    @property
    def names(self) -> tuple[str, ...]:
        """Its dimensions."""
        ...

    def moments(self, displacement: Displacement | None = None) -> Moments:
        """Say its moments, as they would be after a displacement."""
        ...

    def joint(self, names: Sequence[str]) -> Joint:
        """Say mean and covariance of some dimensions together."""
        ...
