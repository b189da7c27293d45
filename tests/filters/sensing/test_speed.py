"""Speeds against their densities by scipy, the Rice distribution, and a grid where they teach a scale."""

from __future__ import annotations

import math
from typing import Any, cast

import numpy as np
import pytest
from scipy import stats

from filters.motion import FREE, ConstantVelocity
from filters.motion.learned import Learned
from filters.particle import ParticleFilter
from filters.particle_set import ParticleSet
from filters.sensing.speed import GroundSpeed, GroundSpeedMeasurement, WheelSpeed, WheelSpeedMeasurement

COUNT = 2000
NAMES = ("north", "east", "heading", "gyro_bias", "odometry_scale", "k", "b")
FREE_NAMES = ("north", "east", "heading", "velocity_north", "velocity_east", "k", "b")


def some_particles(names: tuple[str, ...], spreads: dict[str, tuple[float, float]]) -> ParticleSet:
    rng = np.random.default_rng(1)
    particles = ParticleSet(names, COUNT)
    particles.count = COUNT
    for row, name in enumerate(names):
        particles.columns[row] = rng.normal(*spreads.get(name, (0.0, 1.0)), COUNT)
    particles.variances["b"] = 0.16
    return particles


def check(particles: ParticleSet, constant: float, residual: object, noise: float, outliers: float) -> None:
    """Compare with the mixture's density of ``residual`` and ``noise`` (both of the whole), by scipy."""
    hit = (1.0 - outliers) * stats.norm.pdf(residual, 0.0, math.sqrt(noise))
    wanted = np.log(hit + outliers / 60.0)
    seen = wanted > -60.0
    assert seen.sum() > 1000
    np.testing.assert_allclose(particles.log_weights[seen] + constant, wanted[seen], rtol=3e-4, atol=3e-4)
    assert particles.log_weights.max() < 1e-4


@pytest.mark.interpreted
@pytest.mark.parametrize("outliers", [0.0, 0.1])
@pytest.mark.parametrize(("scale", "bias"), [(None, None), ("k", "b"), ("k", None), (None, "b")])
def test_a_wheel_says_what_its_place_does(outliers: float, scale: str | None, bias: str | None) -> None:
    particles = some_particles(
        NAMES, {"gyro_bias": (0.01, 0.02), "odometry_scale": (1.0, 0.05), "k": (1.0, 0.03), "b": (0.1, 0.2)}
    )
    before = particles.columns.astype(np.float64)
    sensor = WheelSpeed(0.4, outliers, 60.0, scale, bias)
    measurement = WheelSpeedMeasurement(5.2, 5.0, 0.4, -0.7, 0.3)
    constant = sensor.weigh(particles, 0, COUNT, measurement)
    speed = before[4] * 5.0 + 0.7 * (0.4 - before[3])
    residual = 5.2 - (before[5] if scale else 1.0) * speed - (before[6] if bias else 0.0)
    noise = 0.09 + (0.16 if bias else 0.0)
    check(particles, constant, residual, noise, outliers)
    hit = (1.0 - outliers) * stats.norm.pdf(residual, 0.0, math.sqrt(noise))
    taught = hit / (hit + outliers / 60.0 + 1e-300) * 0.16 / noise * residual if bias else 0.0
    np.testing.assert_allclose(particles.columns[6], before[6] + taught, atol=1e-4)
    np.testing.assert_array_equal(particles.columns[:6], before[:6].astype(np.float32))


@pytest.mark.interpreted
@pytest.mark.parametrize("outliers", [0.0, 0.1])
@pytest.mark.parametrize(("scale", "bias"), [(None, None), ("k", "b")])
def test_a_free_mover_goes_as_fast_as_its_velocity(
    outliers: float, scale: str | None, bias: str | None
) -> None:
    particles = some_particles(FREE_NAMES, {"k": (1.0, 0.03), "b": (0.1, 0.2)})
    before = particles.columns.astype(np.float64)
    sensor = GroundSpeed(0.3, outliers, 60.0, scale, bias)
    constant = sensor.weigh(particles, 0, COUNT, GroundSpeedMeasurement(1.3, None, 0.04))
    speed = np.sqrt(before[3] ** 2 + before[4] ** 2 + 0.04)
    residual = 1.3 - (before[5] if scale else 1.0) * speed - (before[6] if bias else 0.0)
    check(particles, constant, residual, 0.09 + 0.04 + (0.16 if bias else 0.0), outliers)
    np.testing.assert_array_equal(particles.columns[:6], before[:6].astype(np.float32))


@pytest.mark.parametrize("speed", [0.0, 0.3, 1.0, 3.0, 10.0])
def test_the_mean_of_a_speed_is_rices(speed: float) -> None:
    """To a quarter of sigma at a stand, and to 2 % of it from three sigmas on."""
    sigma = 0.4
    centre = {"velocity_north": 0.6 * speed, "velocity_east": -0.8 * speed}
    expected = -GroundSpeed(1.0).innovation(centre, GroundSpeedMeasurement(0.0, None, sigma**2))
    mean = float(cast(Any, stats.rice).mean(speed / sigma, scale=sigma))
    assert expected == pytest.approx(mean, abs=(0.02 if speed > 3.0 * sigma - 1e-9 else 0.26) * sigma)


def test_a_speed_finds_the_scale_of_the_odometry_as_a_grid_does() -> None:
    """20 speeds of a wheel that is counted 4 % short: mean to 0.05 standard deviations, and the deviation to 5 %."""
    count = 40_000
    rng = np.random.default_rng(7)
    particles = ParticleSet(NAMES[:5], count)
    particles.count = count
    particles.columns[4] = rng.normal(1.0, 0.05, count)
    sensor = WheelSpeed(0.3, outliers=0.05, span=60.0)
    grid = np.linspace(0.7, 1.3, 4001)
    log = stats.norm.logpdf(grid, 1.0, 0.05)
    for measured in rng.normal(1.04 * 4.0, 0.3, 20):
        sensor.weigh(particles, 0, count, WheelSpeedMeasurement(measured, 4.0))
        log += np.log(0.95 * stats.norm.pdf(measured, 4.0 * grid, 0.3) + 0.05 / 60.0)
    exact = np.exp(log - log.max())
    exact /= exact.sum()
    mean = float(exact @ grid)
    deviation = math.sqrt(float(exact @ (grid - mean) ** 2))
    weights = np.exp(particles.log_weights.astype(np.float64))
    weights /= weights.sum()
    scales = particles.columns[4].astype(np.float64)
    found = float(weights @ scales)
    assert found == pytest.approx(mean, abs=0.05 * deviation)
    assert math.sqrt(float(weights @ (scales - found) ** 2)) == pytest.approx(deviation, rel=0.05)


def test_a_speed_tells_a_free_mover_how_fast_and_not_where_to() -> None:
    """Started with any velocity of 2 m/s per axis, and told 1.5 m/s for 2 s: the mean speed is that to 0.15 m/s, and
    the mean velocity is still nothing."""
    motion = ConstantVelocity(0.05, 2.0)
    belief = ParticleFilter(motion, capacity=20_000, seed=4, slow=[Learned("b", 0.0, 0.02)])
    belief.initialize({name: np.zeros(20_000) for name in belief.names})
    sensor = GroundSpeed(0.2, bias="b")
    for _ in range(20):
        belief.predict(FREE, 0.1)
        loose = motion.conditional_variances["velocity_north"]
        belief.weigh(sensor, GroundSpeedMeasurement(1.5, None, loose))
        belief.resample()
    north, east = belief.column("velocity_north"), belief.column("velocity_east")
    assert float(np.hypot(north, east).mean()) == pytest.approx(1.5, abs=0.15)
    assert math.hypot(float(north.mean()), float(east.mean())) < 0.3


def test_what_cannot_be_is_refused() -> None:
    assert "within 60" in (WheelSpeed(1.0, 0.1, 60.0).refusal(WheelSpeedMeasurement(-61.0, 0.0)) or "")
    assert "negative" in (GroundSpeed(1.0).refusal(GroundSpeedMeasurement(-1.0)) or "")
    assert "negative" in (GroundSpeed(1.0).refusal(GroundSpeedMeasurement(1.0, None, -1.0)) or "")
    assert "sigma" in (GroundSpeed(1.0).refusal(GroundSpeedMeasurement(1.0, 0.0)) or "")
    assert WheelSpeed(1.0).refusal(WheelSpeedMeasurement(-3.0, 1.0)) is None
    with pytest.raises(ValueError, match="sigma"):
        WheelSpeed(0.0)
    with pytest.raises(KeyError, match="odometry_scale"):
        WheelSpeed(1.0).weigh(ParticleSet(FREE_NAMES, 4), 0, 4, WheelSpeedMeasurement(1.0, 1.0))
    with pytest.raises(KeyError, match="velocity_north"):
        GroundSpeed(1.0).weigh(ParticleSet(NAMES, 4), 0, 4, GroundSpeedMeasurement(1.0))
