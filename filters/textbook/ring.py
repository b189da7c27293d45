"""Exercises 2 and 5: one metre forward in a direction that nobody knows, exactly, by linearisation and as particles.

The nonlinear system of chapter 3's exercise 4. The transition is deterministic,

    x' = x + cos θ,   y' = y + sin θ,   θ' = θ

and the start is Gaussian: mean 0, variances 0.01 m² for x and y and 10,000 rad² for θ. A standard deviation of 100 rad,
sixteen turns, leaves the heading uniform to within e^(-5000). So the intuition is a **ring**: radius 1 m, 0.1 m thick.
Then x is measured with Q = 0.01 m²; the chapter gives no z, here it is 0.5 m. Two places on the ring remain.

Given θ all is Gaussian, so the exact belief is an integral over the heading alone; a sum over equally spaced headings
converges to it faster than any power (it is periodic), and is exact to float64 here.

    p(x', y')     = 1/2π ∫ N(x'; cos θ, s) N(y'; sin θ, s) dθ,   s = 0.01
                  = exp(-(r² + 1) / 2s) I₀(r / s) / (2π s)
    p(z)          = 1/2π ∫ N(z; cos θ, s + Q) dθ
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from filters.extended_kalman import ExtendedKalmanFilter, Transition
from filters.kalman import Expectation
from filters.motion import Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.textbook import normal
from filters.textbook.error import root_mean_square
from filters.textbook.projection import Projection, ProjectionMeasurement

VARIANCE = 0.01
"""Of x and y at the start, square metres."""
HEADING_VARIANCE = 10_000.0
"""Square radians."""
NOISE = 0.01
"""Q, square metres."""
MEASURED = 0.5
"""z, metres: the chapter leaves it open."""
COUNTS = (25, 100, 400, 1_600, 6_400, 25_600)
_ANGLES = 4096


@dataclass(frozen=True)
class Position:
    """A belief about (x, y) by its moments, before and after the measurement.

    Attributes
    ----------
    means : (2, 2) float64
        Predicted, then corrected; metres.
    covariances : (2, 2, 2) float64
        Square metres.
    log_evidence : float
        Logarithm of p(z), in log(1/m).
    """

    means: NDArray[np.float64]
    covariances: NDArray[np.float64]
    log_evidence: float


@dataclass(frozen=True)
class Cloud:
    """The belief as particles.

    Attributes
    ----------
    count : int
    poses : (count, 3) float64
        x, y, heading after the motion.
    weights : (count,) float64
        After the measurement, summing to one.
    moments : Position
    upper : float
        Share of the weight where y > 0; exactly one half belongs there.
    effective_sample_size : float
        After the measurement.
    """

    count: int
    poses: NDArray[np.float64]
    weights: NDArray[np.float64]
    moments: Position
    upper: float
    effective_sample_size: float


@dataclass(frozen=True)
class Convergence:
    """How far particles are from the exact belief, by their number; root mean squares over the repetitions.

    Attributes
    ----------
    counts : (n,) int64
    mean_errors : (n,) float64
        Distance of the posterior mean, metres.
    upper_errors : (n,) float64
        Of the upper place's share.
    lost : (n,) float64
        Share of the repetitions in which, after five resamplings, only one of the two places is left.
    """

    counts: NDArray[np.int64]
    mean_errors: NDArray[np.float64]
    upper_errors: NDArray[np.float64]
    lost: NDArray[np.float64]


def _headings() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    angle = (np.arange(_ANGLES) + 0.5) * (2.0 * math.pi / _ANGLES)
    return np.cos(angle), np.sin(angle)


def density(x: ArrayLike, y: ArrayLike) -> NDArray[np.float64]:
    """Exact density of the position after the motion, 1/m²; by the Bessel function, for r below 7 m."""
    r = np.hypot(np.asarray(x, np.float64), np.asarray(y, np.float64))
    return np.exp(-(r * r + 1.0) / (2.0 * VARIANCE)) * np.i0(r / VARIANCE) / (2.0 * math.pi * VARIANCE)


def posterior(x: ArrayLike, y: ArrayLike, measured: float = MEASURED) -> NDArray[np.float64]:
    """Exact density of the position after the measurement, 1/m²."""
    evidence = math.exp(exact(measured).log_evidence)
    return density(x, y) * normal.density(measured, x, math.sqrt(NOISE)) / evidence


def exact(measured: float = MEASURED) -> Position:
    """Exercise 2 without approximation."""
    cosine, sine = _headings()
    prior = np.array([[0.5 + VARIANCE, 0.0], [0.0, 0.5 + VARIANCE]])
    likelihood = normal.density(measured, cosine, math.sqrt(VARIANCE + NOISE))
    evidence = float(likelihood.mean())
    weight = likelihood / likelihood.sum()
    gain = VARIANCE / (VARIANCE + NOISE)
    x = cosine + gain * (measured - cosine)
    mean = np.array([weight @ x, 0.0])
    variance_x = weight @ (x - mean[0]) ** 2 + (1.0 - gain) * VARIANCE
    corrected = np.array([[variance_x, 0.0], [0.0, weight @ sine**2 + VARIANCE]])
    return Position(np.array([np.zeros(2), mean]), np.array([prior, corrected]), math.log(evidence))


class Forward:
    """One metre in the direction of the heading, linearised at the mean, for the extended Kalman filter."""

    names = ("x", "y", "heading")
    angles = (2,)

    def move(self, mean: NDArray[np.float64], control: None, duration: float) -> Transition:
        """See :class:`filters.extended_kalman.LinearisedMotion`; there is no control, and no noise."""
        del control
        cosine, sine = duration * math.cos(mean[2]), duration * math.sin(mean[2])
        jacobian = np.array([[1.0, 0.0, -sine], [0.0, 1.0, cosine], [0.0, 0.0, 1.0]])
        return Transition(mean + np.array([cosine, sine, 0.0]), jacobian, np.zeros((3, 3)))


class FirstCoordinate:
    """The measurement of x for the extended Kalman filter; it is linear."""

    def expect(
        self, rows: Mapping[str, int], mean: NDArray[np.float64], measurement: ProjectionMeasurement
    ) -> Expectation:
        """See :class:`filters.extended_kalman.LinearisedSensor`."""
        model = np.zeros((1, mean.size))
        model[0, rows["x"]] = 1.0
        return Expectation(np.array([measurement.x]), model @ mean, model, np.array([[NOISE]]))


def extended(measured: float = MEASURED) -> Position:
    """Exercise 2 by the extended Kalman filter: a line where the ring should be."""
    belief = ExtendedKalmanFilter(Forward(), np.zeros(3), np.diag([VARIANCE, VARIANCE, HEADING_VARIANCE]))
    belief.predict(None, 1.0)
    predicted = belief.mean, belief.covariance
    correction = belief.correct(FirstCoordinate(), ProjectionMeasurement(measured))
    beliefs = (predicted, (belief.mean, belief.covariance))
    return Position(
        np.array([mean[:2] for mean, _ in beliefs]),
        np.array([covariance[:2, :2] for _, covariance in beliefs]),
        correction.log_evidence,
    )


def particles(count: int, seed: int, measured: float = MEASURED) -> Cloud:
    """Exercise 5: exercise 2 with ``count`` particles; the motion is the daemon's unicycle without noise."""
    belief, poses = _moved(count, seed)
    evidence = belief.weigh(Projection(NOISE), ProjectionMeasurement(measured))
    weights = belief.weights.astype(np.float64)
    weights /= weights.sum()
    means, covariances = zip(
        *(_moments(poses[:, :2], weight) for weight in (np.full(count, 1.0 / count), weights)), strict=True
    )
    moments = Position(np.array(means), np.array(covariances), evidence.log_mean)
    upper = float(weights[poses[:, 1] > 0.0].sum())
    return Cloud(count, poses, weights, moments, upper, belief.effective_sample_size)


def convergence(repetitions: int = 30, counts: tuple[int, ...] = COUNTS) -> Convergence:
    """Exercise 5 over several counts, each with seeds 0 … ``repetitions`` - 1."""
    truth = exact().means[1]
    errors = np.empty((len(counts), 3))
    for row, count in enumerate(counts):
        clouds = [particles(count, seed) for seed in range(repetitions)]
        away = np.array([cloud.moments.means[1] - truth for cloud in clouds])
        upper = np.array([cloud.upper - 0.5 for cloud in clouds])
        lost = sum(_one_place_left(count, seed) for seed in range(repetitions)) / repetitions
        errors[row] = root_mean_square(np.linalg.norm(away, axis=1)), root_mean_square(upper), lost
    return Convergence(np.array(counts), *errors.T)


def _moved(count: int, seed: int) -> tuple[ParticleFilter[UnicycleControl], NDArray[np.float64]]:
    """Draw from the start's Gaussian, and move one metre."""
    generator = np.random.default_rng(seed)
    belief = ParticleFilter(Unicycle(0.0, 0.0, 0.0, 0.0), capacity=count, seed=seed)
    belief.initialize(
        {
            "north": generator.normal(0.0, math.sqrt(VARIANCE), count),
            "east": generator.normal(0.0, math.sqrt(VARIANCE), count),
            "heading": generator.normal(0.0, math.sqrt(HEADING_VARIANCE), count),
            "gyro_bias": np.zeros(count),
            "odometry_scale": np.ones(count),
        }
    )
    belief.predict(UnicycleControl(1.0, 0.0), 1.0)
    return belief, np.column_stack([belief.column(name) for name in belief.names[:3]]).astype(np.float64)


def _one_place_left(count: int, seed: int, times: int = 5) -> bool:
    """Measure and resample ``times`` over; say whether all particles then lie on one side of the x axis."""
    belief, _ = _moved(count, seed)
    for _ in range(times):
        belief.weigh(Projection(NOISE), ProjectionMeasurement(MEASURED))
        belief.resample()
    above = belief.column("east") > 0.0
    return bool(above.all() or not above.any())


def _moments(
    points: NDArray[np.float64], weights: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    mean = weights @ points
    centred = points - mean
    return mean, np.einsum("m,mi,mj->ij", weights, centred, centred)
