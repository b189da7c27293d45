"""Exercises 1 and 4: a car with position and velocity, as a Kalman filter and as particles.

The system of chapter 3's exercises 1 and 2, with a time step of one second. The acceleration a is drawn anew in every
step from N(0, 1), and nothing else drives the car:

    x' = x + v + a/2        A = [1 1; 0 1]
    v' = v + a              R = g gᵀ, g = (1/2, 1)

It stands at the origin at t = 0, for certain. Five predictions follow. At t = 5 the position is measured, z = 5, with
variance Q = 10. The state is (x, v); R has rank one, so at t = 1 all belief lies on the line x = v/2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy import float32
from numpy.typing import NDArray

from filters.kalman import KalmanFilter
from filters.kernels.compile import Float32Array
from filters.motion.slow import RandomWalk
from filters.particle import ParticleFilter
from filters.particle_set import ParticleSet
from filters.textbook.error import root_mean_square
from filters.textbook.projection import Projection, ProjectionMeasurement

TRANSITION = np.array([[1.0, 1.0], [0.0, 1.0]])
GAIN = np.array([0.5, 1.0])
"""What an acceleration of one does to (x, v) within a step."""
MODEL = np.array([[1.0, 0.0]])
STEPS = 5
MEASURED = 5.0
"""z, metres."""
NOISE = 10.0
"""Q, square metres."""
COUNTS = (25, 100, 400, 1_600, 6_400, 25_600)


@dataclass(frozen=True)
class Gaussians:
    """A belief over time, by its moments.

    Attributes
    ----------
    means : (STEPS + 2, 2) float64
        Of (x, v) at t = 0 … 5, and last at t = 5 after the measurement; metres and metres per second.
    covariances : (STEPS + 2, 2, 2) float64
    log_evidence : float
        Logarithm of p(z), in log(1/m).
    """

    means: NDArray[np.float64]
    covariances: NDArray[np.float64]
    log_evidence: float


@dataclass(frozen=True)
class Particles:
    """The same belief as particles.

    Attributes
    ----------
    count : int
    clouds : tuple of (count, 2) float64
        (x, v) at t = 0 … 5.
    weights : (count,) float64
        At t = 5 after the measurement, summing to one.
    moments : Gaussians
        Means and covariances of the particles.
    effective_sample_size : float
        After the measurement.
    """

    count: int
    clouds: tuple[NDArray[np.float64], ...]
    weights: NDArray[np.float64]
    moments: Gaussians
    effective_sample_size: float


@dataclass(frozen=True)
class Convergence:
    """How far particles are from the Kalman filter, by their number.

    Attributes
    ----------
    counts : (n,) int64
    mean_errors : (n,) float64
        Root mean square over the repetitions of the posterior mean's distance, by Mahalanobis: in standard deviations.
    covariance_errors : (n,) float64
        The same of the Frobenius norm of the covariance's error, over that of the covariance.
    evidence_errors : (n,) float64
        The same of the logarithm of p(z).
    """

    counts: NDArray[np.int64]
    mean_errors: NDArray[np.float64]
    covariance_errors: NDArray[np.float64]
    evidence_errors: NDArray[np.float64]


def kalman() -> Gaussians:
    """Exercise 1 by the Kalman filter, which is exact here: the answer that every other filter is held against."""
    belief = KalmanFilter(np.zeros(2), np.zeros((2, 2)))
    rows = [(belief.mean, belief.covariance)]
    for _ in range(STEPS):
        belief.predict(TRANSITION, np.outer(GAIN, GAIN))
        rows.append((belief.mean, belief.covariance))
    told = belief.correct([MEASURED], MODEL, [[NOISE]])
    rows.append((belief.mean, belief.covariance))
    return Gaussians(np.array([m for m, _ in rows]), np.array([c for _, c in rows]), told.log_evidence)


class Coasting(NamedTuple):
    """The control of a car that nobody drives: there is none."""


class RandomAcceleration:
    """Line 4 of Table 4.3 for the car; its x is the column ``north``, and ``east`` and ``heading`` stay zero."""

    names = ("north", "east", "heading", "velocity")
    noises = 1
    walks: tuple[RandomWalk, ...] = ()

    @property
    def conditional_variances(self) -> dict[str, float]:
        """Nothing is marginalised."""
        return {}

    def start(self) -> None:
        """Forget nothing: nothing is learned."""

    def begin(self, control: Coasting, duration: float) -> float:
        """Return the duration; see :class:`filters.motion.Motion`."""
        del control
        return duration

    def move(self, particles: ParticleSet, first: int, last: int, noise: Float32Array, step: float) -> None:
        """Accelerate every particle of a block by its own draw."""
        north = particles.columns[0, first:last]
        velocity = particles.columns[3, first:last]
        change = noise[0, : last - first] * float32(step)
        north += (velocity + change * float32(0.5)) * float32(step)
        velocity += change


def particles(count: int, seed: int) -> Particles:
    """Exercise 4: exercise 1 with ``count`` particles."""
    belief = ParticleFilter(RandomAcceleration(), capacity=count, seed=seed)
    belief.initialize({name: np.zeros(count) for name in RandomAcceleration.names})
    equal = np.full(count, 1.0 / count)
    clouds = [_cloud(belief)]
    for _ in range(STEPS):
        belief.predict(Coasting(), 1.0)
        clouds.append(_cloud(belief))
    evidence = belief.weigh(Projection(NOISE), ProjectionMeasurement(MEASURED))
    weights = belief.weights.astype(np.float64)
    weights /= weights.sum()
    rows = [*((cloud, equal) for cloud in clouds), (clouds[-1], weights)]
    means = np.array([weight @ cloud for cloud, weight in rows])
    covariances = np.array(
        [
            np.einsum("m,mi,mj->ij", weight, cloud - mean, cloud - mean)
            for (cloud, weight), mean in zip(rows, means, strict=True)
        ]
    )
    moments = Gaussians(means, covariances, evidence.log_mean)
    return Particles(count, tuple(clouds), weights, moments, belief.effective_sample_size)


def convergence(repetitions: int = 30, counts: tuple[int, ...] = COUNTS) -> Convergence:
    """Exercise 4 over several counts, each with seeds 0 … ``repetitions`` - 1."""
    exact = kalman()
    information: NDArray[np.float64] = np.asarray(np.linalg.inv(exact.covariances[-1]), np.float64)
    size = np.linalg.norm(exact.covariances[-1])
    errors = np.empty((len(counts), 3))
    for row, count in enumerate(counts):
        runs = [particles(count, seed).moments for seed in range(repetitions)]
        away = np.array([run.means[-1] - exact.means[-1] for run in runs])
        spread = np.array(
            [np.linalg.norm(run.covariances[-1] - exact.covariances[-1]) / size for run in runs]
        )
        evidence = np.array([run.log_evidence - exact.log_evidence for run in runs])
        mahalanobis = np.sqrt(np.einsum("ri,ij,rj->r", away, information, away))
        errors[row] = [root_mean_square(values) for values in (mahalanobis, spread, evidence)]
    return Convergence(np.array(counts), *errors.T)


def _cloud(belief: ParticleFilter[Coasting]) -> NDArray[np.float64]:
    return np.column_stack((belief.column("north"), belief.column("velocity"))).astype(np.float64)
