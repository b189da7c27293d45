"""A robot among landmarks that measures distances only: the lecture's particle filter, and the 2 that it forgets.

The robot starts anywhere in a square, drives a stretch, measures its distance to every landmark, and resamples. The
weight of a particle at distance μ₀ from a landmark is the Gaussian of the measured distance μ:

    w = 1/√(2πσ²) exp(-(μ - μ₀)² / 2σ²)

The lecture's slide writes σ² below the fraction, without the 2. That is a Gaussian of variance σ²/2: every measurement
is believed twice as much as it deserves, and the belief's covariance comes out half as large as it should. Of two
dimensions, the region that claims a probability p then holds the truth only with

    1 - √(1 - p)

which is 78 % where 95 % is claimed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from filters.motion import Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.sensing import Range, RangeMeasurement

LANDMARKS = ((20.0, 20.0), (20.0, 80.0), (80.0, 20.0), (80.0, 80.0))
"""North and east, metres."""
SIDE = 100.0
"""Of the square, metres."""
SIGMA = 4.0
"""Of a measured distance, metres."""
CLAIMS = (0.5, 0.68, 0.8, 0.9, 0.95, 0.99)
STRETCH = UnicycleControl(20.0, 0.3)
"""How far the robot drives and turns, metres and radians, between two measurements."""


@dataclass(frozen=True)
class Stage:
    """The belief at one stage of a step.

    Attributes
    ----------
    name : str
    truth : (3,) float64
        North, east, heading.
    cloud : (shown, 4) float32
        North, east, heading and weight of particles.
    estimate : (2,) float64
        The weighted mean, metres: the lecture's result.
    """

    name: str
    truth: NDArray[np.float64]
    cloud: NDArray[np.float32]
    estimate: NDArray[np.float64]


@dataclass(frozen=True)
class Coverage:
    """How often the truth lay in regions that claim to hold it.

    Attributes
    ----------
    claims : (n,) float64
        Probabilities claimed.
    right, forgetful : (n,) float64
        Shares of the runs with the truth inside, for the Gaussian with the 2 and without.
    theory : (n,) float64
        1 - √(1 - p), for the Gaussian without.
    covariance_ratio : float
        Determinant of the forgetful covariance over that of the right one, its root, in the mean; 1/2 expected.
    runs : int
    """

    claims: NDArray[np.float64]
    right: NDArray[np.float64]
    forgetful: NDArray[np.float64]
    theory: NDArray[np.float64]
    covariance_ratio: float
    runs: int


def localize(count: int = 20_000, seed: int = 2, steps: int = 2) -> list[Stage]:
    """Run the lecture's four stages: anywhere, moved, weighted, resampled; then the same once more."""
    generator = np.random.default_rng(seed)
    belief = ParticleFilter(Unicycle(0.5, 0.05, 0.0, 0.0), capacity=count, seed=seed)
    belief.initialize(
        {
            "north": generator.uniform(0.0, SIDE, count),
            "east": generator.uniform(0.0, SIDE, count),
            "heading": generator.uniform(-math.pi, math.pi, count),
            "gyro_bias": np.zeros(count),
            "odometry_scale": np.ones(count),
        }
    )
    truth = np.array([30.0, 35.0, 0.6])
    stages = [_stage("start: anywhere", belief, truth)]
    for step in range(1, steps + 1):
        middle = truth[2] + 0.5 * STRETCH.turn
        truth = truth + np.array([math.cos(middle), math.sin(middle), 0.0]) * STRETCH.distance
        truth[2] += STRETCH.turn
        belief.predict(STRETCH, 1.0)
        stages.append(_stage(f"step {step}: moved", belief, truth))
        _weigh(belief, truth[:2], SIGMA, generator.normal(0.0, SIGMA, len(LANDMARKS)))
        stages.append(_stage(f"step {step}: weighted", belief, truth))
        belief.resample()
        stages.append(_stage(f"step {step}: resampled", belief, truth))
    return stages


def coverage(runs: int = 600, count: int = 6_000, seed: int = 1) -> Coverage:
    """Localize ``runs`` robots at rest, each by both Gaussians, from a start known to 10 m."""
    generator = np.random.default_rng(seed)
    claims = np.array(CLAIMS)
    inside = np.zeros((2, claims.size))
    roots = np.zeros((runs, 2))
    for run in range(runs):
        start = generator.uniform(40.0, 60.0, 2)
        truth = start + generator.normal(0.0, 10.0, 2)
        noise = generator.normal(0.0, SIGMA, len(LANDMARKS))
        particles = start[:, None] + generator.normal(0.0, 10.0, (2, count))
        for row, sigma in enumerate((SIGMA, SIGMA / math.sqrt(2.0))):
            belief = ParticleFilter(Unicycle(0.0, 0.0, 0.0, 0.0), capacity=count, seed=run)
            belief.initialize(
                dict(zip(("north", "east"), particles, strict=True))
                | {name: np.zeros(count) for name in ("heading", "gyro_bias", "odometry_scale")}
            )
            _weigh(belief, truth, sigma, noise)
            moments = belief.moments()
            covariance = moments.pose_covariance[:2, :2]
            away = moments.mean[:2] - truth
            square = float(away @ np.linalg.solve(covariance, away))
            inside[row] += square <= -2.0 * np.log1p(-claims)
            roots[run, row] = math.sqrt(float(np.linalg.det(covariance)))
    ratio = float((roots[:, 1] / roots[:, 0]).mean())
    return Coverage(claims, inside[0] / runs, inside[1] / runs, 1.0 - np.sqrt(1.0 - claims), ratio, runs)


def _weigh(
    belief: ParticleFilter[UnicycleControl],
    place: NDArray[np.float64],
    sigma: float,
    noise: NDArray[np.float64],
) -> None:
    sensor = Range(sigma, outliers=0.0)
    for landmark, error in zip(LANDMARKS, noise, strict=True):
        distance = math.hypot(place[0] - landmark[0], place[1] - landmark[1]) + error
        belief.weigh(sensor, RangeMeasurement(max(distance, 0.01), *landmark))
    belief.normalize()


def _stage(name: str, belief: ParticleFilter[UnicycleControl], truth: NDArray[np.float64]) -> Stage:
    moments = belief.moments()
    return Stage(name, truth, belief.cloud(1_200).copy(), moments.mean[:2])
