"""Unicycle motion against a float64 rewriting with the same normals, and against itself at other rates."""

from __future__ import annotations

import math

import numpy as np
import pytest

from filters.motion import RandomWalk, Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.particle_set import ParticleSet

NAMES = ("north", "east", "heading", "gyro_bias", "odometry_scale")


def some_particles(count: int, seed: int = 1) -> ParticleSet:
    rng = np.random.default_rng(seed)
    particles = ParticleSet(NAMES, count)
    particles.count = count
    particles.columns[:] = (
        rng.normal(0, 10, count),
        rng.normal(0, 10, count),
        rng.uniform(-math.pi, math.pi, count),
        rng.normal(0, 0.1, count),
        rng.normal(1, 0.1, count),
    )
    return particles


@pytest.mark.parametrize(
    "control", [UnicycleControl(0.4, 0.3), UnicycleControl(-0.4, -3.0), UnicycleControl(0.0, 0.0)]
)
@pytest.mark.parametrize(("first", "last"), [(0, 1000), (17, 400), (3, 4)])
def test_one_step_is_the_equation(control: UnicycleControl, first: int, last: int) -> None:
    motion = Unicycle(0.5, 0.2, 0.0, 0.0, slip_noise=0.3, turn_noise=0.1)
    particles = some_particles(1000)
    before = particles.columns.astype(np.float64)
    noise = np.random.default_rng(2).standard_normal((2, last - first)).astype(np.float32)
    duration = 0.25
    motion.move(particles, first, last, noise, control, duration)

    north, east, heading, bias, scale = before[:, first:last]
    sigma_d = math.sqrt(0.5**2 * duration + 0.3**2 * abs(control.distance))
    sigma_t = math.sqrt(0.2**2 * duration + 0.1**2 * abs(control.turn))
    d = scale * control.distance + sigma_d * noise[0]
    t = control.turn - bias * duration + sigma_t * noise[1]
    after = particles.columns[:, first:last].astype(np.float64)
    np.testing.assert_allclose(after[0], north + d * np.cos(heading + t / 2), atol=1e-5)
    np.testing.assert_allclose(after[1], east + d * np.sin(heading + t / 2), atol=1e-5)
    np.testing.assert_allclose(np.exp(1j * after[2]), np.exp(1j * (heading + t)), atol=2e-6)
    assert np.abs(after[2]).max() <= math.pi + 1e-6
    outside = np.ones(1000, bool)
    outside[first:last] = False
    assert np.array_equal(particles.columns[:, outside], before.astype(np.float32)[:, outside])


def run(rate: int, seconds: float, count: int = 60_000) -> ParticleFilter[UnicycleControl]:
    """Drive a curve at a rate of ticks."""
    motion = Unicycle(0.3, 0.05, 0.02, 0.03, slip_noise=0.1, turn_noise=0.1)
    belief = ParticleFilter(motion, capacity=count, seed=5, slow=[RandomWalk("range_scale", 0.01)])
    zeros, ones = np.zeros(count), np.ones(count)
    belief.initialize(
        {
            "north": zeros,
            "east": zeros,
            "heading": zeros,
            "gyro_bias": zeros,
            "odometry_scale": ones,
            "range_scale": ones,
        }
    )
    for _ in range(round(seconds * rate)):
        belief.predict(UnicycleControl(2.0 / rate, 0.2 / rate), 1.0 / rate)
    return belief


def test_the_belief_does_not_depend_on_the_rate_of_the_ticks() -> None:
    """Covariances of 60,000 particles agree within 5 standard deviations, and 1 % for the step."""
    slow, fast = run(20, 4.0).moments(), run(100, 4.0).moments()
    sigma = math.sqrt(2.0 / 60_000)
    scale = np.sqrt(np.outer(fast.variance[:3], fast.variance[:3]))
    assert (
        np.abs(slow.pose_covariance - fast.pose_covariance) < (5 * math.sqrt(2) * sigma + 0.01) * scale
    ).all()
    assert (np.abs(slow.variance / fast.variance - 1.0) < 5 * math.sqrt(2) * sigma + 0.03).all()
    spread = np.sqrt(fast.variance * 2.0 / 60_000)
    assert (np.abs(slow.mean - fast.mean) < 5 * spread + 2e-3).all()


def test_slow_states_walk_as_fast_as_they_say() -> None:
    """Variance walk² · time, to the tenth of a second that they gather, within 5 standard deviations."""
    moments = run(50, 6.0).moments()
    for name, walk in (("gyro_bias", 0.02), ("odometry_scale", 0.03), ("range_scale", 0.01)):
        variance = moments.variance[moments.names.index(name)]
        assert variance / walk**2 == pytest.approx(6.0, abs=0.11 + 6.0 * 5 * math.sqrt(2 / 60_000))


def test_a_bias_turns_and_a_scale_stretches() -> None:
    belief = ParticleFilter(Unicycle(0.0, 0.0, 0.0, 0.0), capacity=1, seed=0)
    belief.initialize(
        {"north": [0], "east": [0], "heading": [0], "gyro_bias": [0.1], "odometry_scale": [1.5]}
    )
    belief.predict(UnicycleControl(2.0, 0.1), 1.0)
    assert belief.moments().mean[:3] == pytest.approx([3.0, 0.0, 0.0], abs=1e-6)


def test_what_is_not_finite_is_refused() -> None:
    motion = Unicycle(0.1, 0.1, 0.0, 0.0)
    particles = some_particles(3)
    before = particles.columns.copy()
    for control in (UnicycleControl(math.nan, 0.0), UnicycleControl(0.0, math.inf)):
        with pytest.raises(ValueError, match="finite"):
            motion.move(particles, 0, 3, np.zeros((2, 3), np.float32), control, 0.1)
    assert np.array_equal(particles.columns, before)
    with pytest.raises(ValueError, match="speed_noise"):
        Unicycle(-0.1, 0.1, 0.0, 0.0)
    with pytest.raises(ValueError, match="turn_noise"):
        Unicycle(0.1, 0.1, 0.0, 0.0, turn_noise=math.inf)
