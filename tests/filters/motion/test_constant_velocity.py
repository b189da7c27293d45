"""Constant velocity against a float64 rewriting, a Kalman filter over the same state, and itself at other rates."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from filters.kalman import KalmanFilter
from filters.motion import FREE, ConstantVelocity
from filters.motion.constant_velocity import carried
from filters.particle import ParticleFilter
from filters.particle_set import ParticleSet
from filters.sensing import Position, PositionMeasurement
from filters.sensing.down import Down, DownMeasurement

PLANE = ("north", "east", "heading", "velocity_north", "velocity_east")
SPACE = (*PLANE, "down", "velocity_down")


def transition(axes: int, duration: float) -> np.ndarray:
    return np.kron([[1.0, duration], [0.0, 1.0]], np.eye(axes))


def process_noise(densities: list[float], duration: float) -> np.ndarray:
    t = duration
    return np.kron([[t**3 / 3, t**2 / 2], [t**2 / 2, t]], np.diag(np.square(densities)))


@pytest.mark.interpreted
@pytest.mark.parametrize(("dimensions", "names"), [(2, PLANE), (3, SPACE)])
@pytest.mark.parametrize(("first", "last"), [(0, 1000), (17, 400), (3, 4)])
def test_one_step_is_the_equation(dimensions: int, names: tuple[str, ...], first: int, last: int) -> None:
    motion = ConstantVelocity(0.8, 1.5, dimensions, vertical_noise=0.3, vertical_sigma=0.4)
    assert motion.names == names
    rng = np.random.default_rng(1)
    particles = ParticleSet(names, 1000)
    particles.count = 1000
    particles.columns[:] = rng.normal(0.0, 3.0, (len(names), 1000))
    before = particles.columns.astype(np.float64)
    noise = rng.standard_normal((4, last - first)).astype(np.float32)
    t = 0.2
    motion.move(particles, first, last, noise, motion.begin(FREE, t))

    wanted = before.copy()
    axes = [("north", 0.8, 1.5), ("east", 0.8, 1.5), ("down", 0.3, 0.4)][:dimensions]
    for z, (name, q, start) in zip(noise, axes, strict=False):
        displaced = t**2 * start**2 + q**2 * t**3 / 3
        shared = t * start**2 + q**2 * t**2 / 2
        position, velocity = names.index(name), names.index(f"velocity_{name}")
        wanted[position, first:last] += before[velocity, first:last] * t + math.sqrt(displaced) * z
        wanted[velocity, first:last] += shared / math.sqrt(displaced) * z
        left = start**2 + q**2 * t - shared**2 / displaced
        assert motion.conditional_variances[f"velocity_{name}"] == pytest.approx(left)
    np.testing.assert_allclose(particles.columns, wanted, rtol=2e-6, atol=2e-6)


def kalman(axes: int, position: float, velocity: float) -> KalmanFilter:
    return KalmanFilter(np.zeros(2 * axes), np.diag([position**2] * axes + [velocity**2] * axes))


def test_a_kalman_filter_over_position_and_velocity_agrees() -> None:
    """The problem is linear and Gaussian. Over 40,000 particles the means agree to 0.06 standard deviations and the
    covariances to 8 %; the worst of 12 other seeds were 0.04 and 4.1 %."""
    q, count, sigma, t = 0.9, 40_000, 0.5, 0.25
    belief = ParticleFilter(ConstantVelocity(q, 2.0), capacity=count, seed=5)
    rng = np.random.default_rng(6)
    zeros = np.zeros(count)
    columns = dict.fromkeys(PLANE, zeros) | {
        "north": rng.normal(0, 1, count),
        "east": rng.normal(0, 1, count),
    }
    belief.initialize(columns)
    oracle = kalman(2, 1.0, 2.0)
    sensor, measured = Position(sigma, outliers=0.0), np.cumsum(rng.normal(0.3, 0.2, (40, 2)), axis=0)
    for north, east in measured:
        belief.predict(FREE, t)
        oracle.predict(transition(2, t), process_noise([q, q], t))
        belief.weigh(sensor, PositionMeasurement(north, east))
        oracle.correct(np.array([north, east]), np.eye(2, 4), sigma**2 * np.eye(2))
        belief.normalize()
        if belief.effective_sample_size < 0.5 * count:
            belief.resample()
        found = belief.joint(("north", "east", "velocity_north", "velocity_east"))
        spread = np.sqrt(np.diag(oracle.covariance))
        assert (np.abs(found.mean - oracle.mean) < 0.06 * spread).all()
        np.testing.assert_allclose(
            found.covariance / np.outer(spread, spread),
            oracle.covariance / np.outer(spread, spread),
            atol=0.08,
        )


@pytest.mark.parametrize("steps", [1, 7])
def test_the_rate_of_the_steps_does_not_matter(steps: int) -> None:
    """Moments after two seconds, of 100,000 particles: within 3 % (six standard errors of a variance)."""
    count, q, start = 100_000, 0.7, 1.2
    belief = ParticleFilter(ConstantVelocity(q, start), capacity=count, seed=steps)
    belief.initialize({name: np.zeros(count) for name in PLANE})
    for _ in range(steps):
        belief.predict(FREE, 2.0 / steps)
    found = belief.joint(("north", "velocity_north"))
    noise = process_noise([q], 2.0)
    wanted = transition(1, 2.0) @ np.diag([0.0, start**2]) @ transition(1, 2.0).T + noise
    np.testing.assert_allclose(found.covariance, wanted, rtol=0.03)


def test_in_three_dimensions_a_height_is_weighed() -> None:
    """A height of 3 m, sigma 0.5, measured ten times, beside a Kalman filter: as above, to 0.06 and 8 %."""
    count = 40_000
    belief = ParticleFilter(ConstantVelocity(0.5, 1.0, 3), capacity=count, seed=3)
    columns = {name: np.zeros(count) for name in SPACE}
    columns["down"] = np.random.default_rng(4).normal(0.0, 2.0, count)
    belief.initialize(columns)
    oracle = kalman(1, 2.0, 1.0)
    for _ in range(10):
        belief.predict(FREE, 0.1)
        oracle.predict(transition(1, 0.1), process_noise([0.5], 0.1))
        belief.weigh(Down(0.5, outliers=0.0), DownMeasurement(3.0))
        oracle.correct(np.array([3.0]), np.eye(1, 2), 0.25 * np.eye(1))
        belief.resample()
    found = belief.joint(("down", "velocity_down"))
    spread = np.sqrt(np.diag(oracle.covariance))
    assert (np.abs(found.mean - oracle.mean) < 0.06 * spread).all()
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), spread, rtol=0.08)


def test_a_gaussian_is_carried_as_by_its_matrices() -> None:
    rng = np.random.default_rng(2)
    root, mean, densities = rng.normal(size=(6, 6)), rng.normal(size=6), np.array([0.5, 0.5, 0.2])
    covariance = root @ root.T
    moved, spread = carried(mean, covariance, densities, 0.3)
    forward = transition(3, 0.3)
    np.testing.assert_allclose(moved, forward @ mean, rtol=1e-12)
    wanted = forward @ covariance @ forward.T + process_noise(list(densities), 0.3)
    np.testing.assert_allclose(spread, wanted, rtol=1e-12)


def test_time_that_stands_still_moves_nothing() -> None:
    belief = ParticleFilter(ConstantVelocity(0.5, 0.0), capacity=10, seed=1)
    belief.initialize({name: np.arange(10.0) * 0.1 for name in PLANE})
    before = belief.columns.copy()
    belief.predict(FREE, 0.0)
    assert (belief.columns == before).all()


def test_a_new_start_forgets_the_velocity() -> None:
    motion = ConstantVelocity(0.5, 3.0)
    motion.begin(FREE, 1.0)
    assert motion.conditional_variances["velocity_east"] < 1.0
    motion.start()
    assert motion.conditional_variances == {"velocity_north": 9.0, "velocity_east": 9.0}


@pytest.mark.parametrize("bad", [-0.1, math.inf, math.nan])
@pytest.mark.parametrize("name", ["acceleration_noise", "velocity_sigma", "vertical_noise", "vertical_sigma"])
def test_what_cannot_be_is_refused(name: str, bad: float) -> None:
    make: Any = ConstantVelocity
    with pytest.raises(ValueError, match=name):
        make(**{"acceleration_noise": 0.5, name: bad})


def test_other_than_two_or_three_dimensions_are_refused() -> None:
    with pytest.raises(ValueError, match="2 or 3"):
        ConstantVelocity(0.5, dimensions=4)
