"""What is added to the moments of a delayed belief when they are carried forward to now.

A belief at the horizon is displaced rigidly, each particle along its own heading, so the spread of the belief itself
is carried exactly (:class:`filters.particle.Displacement`). What that leaves out is the process noise of the interval,
which is small and is added here in closed form, and the velocity, which is not a state but a control.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class IntervalNoise(NamedTuple):
    """Process noise over an interval: variance along the path (m²) and of the heading at its end (rad²)."""

    along: float
    heading: float


def process_covariance(distance: float, heading: float, noise: IntervalNoise) -> NDArray[np.float64]:
    """Return the covariance of (north, east, heading) that an interval's process noise adds.

    The heading's noise is a Wiener process along a straight path of length ``distance`` (m) in direction ``heading``
    (rad): with variance q at the end, the offset across the path has variance q d²/3 and covariance q d/2 with the
    heading (the integrated Wiener process).

    Returns
    -------
    NDArray[np.float64], shape (3, 3)
    """
    cosine, sine = math.cos(heading), math.sin(heading)
    along, q = noise
    across, with_heading = q * distance * distance / 3.0, q * distance / 2.0
    # R L Rᵀ written out: a fifth of the time of small matrices
    nn = along * cosine * cosine + across * sine * sine
    ne = (along - across) * sine * cosine
    ee = along * sine * sine + across * cosine * cosine
    nh, eh = -with_heading * sine, with_heading * cosine
    return np.array([[nn, ne, nh], [ne, ee, eh], [nh, eh, q]])


class VelocityMoments(NamedTuple):
    """Mean velocity north and east (m/s) and its covariance nn, ne, ee ((m/s)²)."""

    north: float
    east: float
    nn: float
    ne: float
    ee: float


def velocity_moments(
    speed: float, speed_variance: float, heading: float, heading_variance: float
) -> VelocityMoments:
    """Return the moments of a velocity of independent Gaussian speed and wrapped-normal heading.

    With R = exp(-σ²/2): E[cos θ] = R cos μ and E[cos² θ] = (1 + R⁴ cos 2μ)/2, exactly, so an unknown heading gives a
    mean of zero and a covariance of half the squared speed per axis, not a small ellipse in a wrong place.
    """
    shrink = math.exp(-0.5 * heading_variance)
    double = math.exp(-2.0 * heading_variance)
    mean_square = speed**2 + speed_variance
    north, east = speed * shrink * math.cos(heading), speed * shrink * math.sin(heading)
    cosine_square = 0.5 * (1.0 + double * math.cos(2.0 * heading))
    sine_square = 0.5 * (1.0 - double * math.cos(2.0 * heading))
    product = 0.5 * double * math.sin(2.0 * heading)
    return VelocityMoments(
        north,
        east,
        mean_square * cosine_square - north**2,
        mean_square * product - north * east,
        mean_square * sine_square - east**2,
    )
