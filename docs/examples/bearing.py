"""Bearing: the direction to a landmark whose place is known, seen from the nose. A worked example.

    expected = atan2(east_b - east, north_b - north) - heading

Directions are circular, so the inlier part is the von Mises distribution, exp(κ (cos δ - 1)) up to a constant, with δ
the difference and κ = 1/sigma². Its cosine is a product of two unit vectors: no arc tangent, which would keep the loop
from vectorising. With the outlier part uniform over the circle.

Run it: python docs/examples/bearing.py
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy import float32

from filters.kernels.compile import Float32Array, kernel
from filters.kernels.elementary import log_mixture, sincos
from filters.motion import Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.particle_set import ParticleSet
from filters.sensing.robust import check, mixture

_CIRCLE = 2.0 * math.pi
_WIDEST = 0.3


class BearingMeasurement(NamedTuple):
    """A bearing (radians clockwise from the nose), and where its landmark stands (metres)."""

    bearing: float
    north: float
    east: float


class Bearing:
    """Von Mises bearing with an outlier part uniform over the circle.

    Parameters
    ----------
    sigma : float
        Standard deviation, radians; up to 0.3, where the normal constant used here is right to 0.1 %.
    outliers : float
        Fraction of measurements that say nothing.

    Raises
    ------
    ValueError
        A parameter out of its range.
    """

    def __init__(self, sigma: float, outliers: float = 0.05) -> None:
        check("bearing", sigma, outliers, _CIRCLE)
        if sigma > _WIDEST:
            raise ValueError(f"bearing: sigma must be at most {_WIDEST} rad, got {sigma}")
        self.sigma = sigma
        self.outliers = outliers

    def refusal(self, measurement: BearingMeasurement) -> str | None:
        """Refuse what is no angle within two turns: a sensor that reports such a number is broken."""
        if abs(measurement.bearing) > 2.0 * _CIRCLE:
            return f"bearing must lie within two turns, got {measurement.bearing:g} rad"
        return None

    def weigh(self, particles: ParticleSet, first: int, last: int, measurement: BearingMeasurement) -> float:
        """Add the log likelihood of a bearing; see :class:`filters.sensing.Sensor`."""
        log_density = -math.log(self.sigma * math.sqrt(_CIRCLE)) - math.log1p(self.sigma**2 / 8.0)
        mixed = mixture(self.outliers, log_density, -math.log(_CIRCLE))
        sight(
            particles.columns,
            particles.log_weights,
            first,
            last,
            measurement.bearing,
            measurement.north,
            measurement.east,
            1.0 / self.sigma**2,
            mixed.log_inlier,
            mixed.log_outlier,
        )
        return mixed.log_peak

    def innovation(self, centre: Mapping[str, float], measurement: BearingMeasurement) -> float:
        """Measured less expected bearing at the centre, radians in [-pi, pi]."""
        direction = math.atan2(measurement.east - centre["east"], measurement.north - centre["north"])
        return math.remainder(measurement.bearing - (direction - centre["heading"]), _CIRCLE)


@kernel(
    "void(float32[:, ::1], float32[::1], int64, int64, float32, float32, float32, float32, float32, float32)"
)
def sight(
    columns: Float32Array,
    log_weights: Float32Array,
    first: int,
    last: int,
    bearing: float,
    landmark_north: float,
    landmark_east: float,
    concentration: float,
    log_inlier: float,
    log_outlier: float,
) -> None:
    """Add the log of the mixture: the measured direction against the direction to the landmark."""
    north = columns[0, first:last]
    east = columns[1, first:last]
    heading = columns[2, first:last]
    log_weight = log_weights[first:last]
    for i in range(last - first):
        n = float32(landmark_north - north[i])
        e = float32(landmark_east - east[i])
        s, c = sincos(float32(heading[i] + bearing))
        away = float32(math.sqrt(float32(n * n + e * e + float32(1e-6))))  # never zero
        cosine = float32(float32(n * c + e * s) / away)
        surprise = float32(concentration * float32(float32(1.0) - cosine))
        log_weight[i] += log_mixture(surprise, log_inlier, log_outlier)


LANDMARKS = ((20.0, 5.0), (-3.0, 18.0), (12.0, -14.0))


def locate(seed: int = 1) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Drive an arc for 10 s by bearings to three landmarks, from a wrong start; return truth and mean pose."""
    rng = np.random.default_rng(seed)
    motion = Unicycle(speed_noise=0.05, yaw_rate_noise=0.02, gyro_bias_walk=0.0, odometry_scale_walk=0.0)
    belief = ParticleFilter(motion, capacity=20_000, seed=seed)
    belief.initialize(
        {
            "north": rng.normal(4.0, 5.0, 20_000),
            "east": rng.normal(-4.0, 5.0, 20_000),
            "heading": rng.normal(0.3, 0.3, 20_000),
            "gyro_bias": np.zeros(20_000),
            "odometry_scale": np.ones(20_000),
        }
    )
    bearing = Bearing(sigma=0.05)
    north, east, heading = 0.0, 0.0, 0.5
    for _ in range(100):
        north += 0.1 * math.cos(heading + 0.01)
        east += 0.1 * math.sin(heading + 0.01)
        heading += 0.02
        belief.predict(UnicycleControl(distance=0.1, turn=0.02), duration=0.1)
        for place in LANDMARKS:
            seen = math.atan2(place[1] - east, place[0] - north) - heading + 0.05 * rng.standard_normal()
            belief.weigh(bearing, BearingMeasurement(seen, *place))
        belief.normalize()
        if belief.effective_sample_size < 0.5 * belief.count:
            belief.resample()
    mean = belief.moments().mean
    return (north, east, heading), tuple(float(value) for value in mean[:3])


if __name__ == "__main__":
    for name, truth, mean in zip(("north", "east", "heading"), *locate(), strict=True):
        print(f"{name:>8}: truth {truth:7.3f}, mean {mean:7.3f}")
