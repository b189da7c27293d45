"""Every sensor model against its likelihood written with scipy's densities, particle by particle."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from filters.particle_set import ParticleSet
from filters.sensing import (
    Heading,
    HeadingMeasurement,
    Position,
    PositionMeasurement,
    Range,
    RangeMeasurement,
    Velocity,
    VelocityMeasurement,
)

NAMES = ("north", "east", "heading", "scale", "bias", "delay")
Columns = Mapping[str, NDArray[np.float64]]
COUNT = 2000


class Case(NamedTuple):
    """A sensor, a measurement, and the inlier and outlier densities that they should have."""

    sensor: Any
    measurement: Any
    inlier: Callable[[Columns], NDArray[np.float64]]
    outlier: float


def distance_to(c: Columns, north: float, east: float, down: float) -> NDArray[np.float64]:
    return np.sqrt((c["north"] - north) ** 2 + (c["east"] - east) ** 2 + down**2)


def antenna(c: Columns, forward: float, right: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    cosine, sine = np.cos(c["heading"]), np.sin(c["heading"])
    return c["north"] + forward * cosine - right * sine, c["east"] + forward * sine + right * cosine


def position_density(
    c: Columns, z: tuple[float, float], sigmas: tuple[float, float], lever: tuple[float, float]
) -> Any:
    north, east = antenna(c, *lever)
    return stats.norm.pdf(z[0], north, sigmas[0]) * stats.norm.pdf(z[1], east, sigmas[1])


def late_position_density(c: Columns, z: tuple[float, float], sigma: float, speed: float, rate: float) -> Any:
    """Of an arc driven back for the delay: the chord of half the turn, exactly, has this length and direction."""
    middle = c["heading"] - 0.5 * rate * c["delay"]
    north, east = (
        c["north"] - speed * c["delay"] * np.cos(middle),
        c["east"] - speed * c["delay"] * np.sin(middle),
    )
    return stats.norm.pdf(z[0], north, sigma) * stats.norm.pdf(z[1], east, sigma)


def velocity_density(c: Columns, z: tuple[float, float, float], sigma: float, scale: bool) -> Any:
    speed = z[2] * (c["scale"] if scale else 1.0)
    return stats.norm.pdf(z[0], speed * np.cos(c["heading"]), sigma) * stats.norm.pdf(
        z[1], speed * np.sin(c["heading"]), sigma
    )


def heading_density(c: Columns, z: float, sigma: float, bias: bool) -> Any:
    difference = z - c["heading"] - (c["bias"] if bias else 0.0)
    return stats.norm.pdf((difference + math.pi) % (2 * math.pi) - math.pi, 0.0, sigma)


CASES = {
    "range": Case(
        Range(0.3, outliers=0.05, span=50.0),
        RangeMeasurement(12.0, 10.0, 5.0, -2.0),
        lambda c: stats.norm.pdf(12.0, distance_to(c, 10.0, 5.0, -2.0), 0.3),
        1 / 50.0,
    ),
    "range, its own sigma, scale and bias": Case(
        Range(0.3, outliers=0.2, span=80.0, scale="scale", bias="bias"),
        RangeMeasurement(12.0, 10.0, 5.0, 1.0, 0.5),
        lambda c: stats.norm.pdf(12.0, c["scale"] * distance_to(c, 10.0, 5.0, 1.0) + c["bias"], 0.5),
        1 / 80.0,
    ),
    "range, bias only": Case(
        Range(0.3, span=80.0, bias="bias"),
        RangeMeasurement(12.0, 10.0, 5.0),
        lambda c: stats.norm.pdf(12.0, distance_to(c, 10.0, 5.0, 0.0) + c["bias"], 0.3),
        1 / 80.0,
    ),
    "range, Gaussian": Case(
        Range(3.0, outliers=0.0),
        RangeMeasurement(12.0, 10.0, 5.0),
        lambda c: stats.norm.pdf(12.0, distance_to(c, 10.0, 5.0, 0.0), 3.0),
        0.0,
    ),
    "range, Gaussian with scale": Case(
        Range(3.0, outliers=0.0, scale="scale"),
        RangeMeasurement(12.0, 10.0, 5.0),
        lambda c: stats.norm.pdf(12.0, c["scale"] * distance_to(c, 10.0, 5.0, 0.0), 3.0),
        0.0,
    ),
    "position": Case(
        Position(1.5, outliers=0.1, span=100.0),
        PositionMeasurement(1.0, -2.0),
        lambda c: position_density(c, (1.0, -2.0), (1.5, 1.5), (0.0, 0.0)),
        1e-4,
    ),
    "position, its own sigmas and a lever": Case(
        Position(1.5, lever=(0.7, -0.4)),
        PositionMeasurement(1.0, -2.0, 0.5, 2.0),
        lambda c: position_density(c, (1.0, -2.0), (0.5, 2.0), (0.7, -0.4)),
        1e-6,
    ),
    "position, one sigma for both": Case(
        Position(1.5),
        PositionMeasurement(1.0, -2.0, 0.5),
        lambda c: position_density(c, (1.0, -2.0), (0.5, 0.5), (0.0, 0.0)),
        1e-6,
    ),
    "velocity": Case(
        Velocity(0.4, span=40.0),
        VelocityMeasurement(1.0, -0.5, 1.3),
        lambda c: velocity_density(c, (1.0, -0.5, 1.3), 0.4, scale=False),
        1 / 1600.0,
    ),
    "velocity, backwards, its own sigma, scale": Case(
        Velocity(0.4, span=40.0, scale="scale"),
        VelocityMeasurement(1.0, -0.5, -1.3, 0.7),
        lambda c: velocity_density(c, (1.0, -0.5, -1.3), 0.7, scale=True),
        1 / 1600.0,
    ),
    "position of an unknown delay": Case(
        Position(1.5, delay="delay"),
        PositionMeasurement(1.0, -2.0, 0.8, None, 4.0, 0.7),
        lambda c: late_position_density(c, (1.0, -2.0), 0.8, 4.0, 0.7),
        1e-6,
    ),
    "velocity of an unknown delay, scale": Case(
        Velocity(0.4, span=40.0, scale="scale", delay="delay"),
        VelocityMeasurement(1.0, -0.5, 1.3, 0.5, -0.9),
        lambda c: velocity_density(
            {**c, "heading": c["heading"] + 0.9 * c["delay"]}, (1.0, -0.5, 1.3), 0.5, scale=True
        ),
        1 / 1600.0,
    ),
    "heading": Case(
        Heading(0.2),
        HeadingMeasurement(3.1),
        lambda c: heading_density(c, 3.1, 0.2, bias=False),
        1 / (2 * math.pi),
    ),
    "heading, turns, its own sigma, bias": Case(
        Heading(0.2, outliers=0.3, bias="bias"),
        HeadingMeasurement(-3.0 + 8 * math.pi, 0.4),
        lambda c: heading_density(c, -3.0, 0.4, bias=True),
        1 / (2 * math.pi),
    ),
}


@pytest.fixture
def particles() -> ParticleSet:
    rng = np.random.default_rng(1)
    result = ParticleSet(NAMES, COUNT)
    result.count = COUNT
    result.columns[:] = (
        rng.normal(0, 6, COUNT),
        rng.normal(0, 6, COUNT),
        rng.uniform(-math.pi, math.pi, COUNT),
        rng.normal(1, 0.1, COUNT),
        rng.normal(0, 0.3, COUNT),
        rng.normal(0.1, 0.2, COUNT),
    )
    return result


def columns(particles: ParticleSet) -> dict[str, NDArray[np.float64]]:
    return {name: particles.columns[row].astype(np.float64) for name, row in particles.rows.items()}


@pytest.mark.interpreted
@pytest.mark.parametrize("name", CASES)
def test_log_likelihood(name: str, particles: ParticleSet) -> None:
    case = CASES[name]
    assert case.sensor.refusal(case.measurement) is None
    particles.log_weights[:] = -1.0
    constant = case.sensor.weigh(particles, 0, COUNT, case.measurement)
    inlier = case.inlier(columns(particles))
    fraction = case.sensor.outliers
    expected = np.log((1.0 - fraction) * inlier + fraction * case.outlier)
    got = particles.log_weights.astype(np.float64) + 1.0 + constant
    deviations = np.sqrt(np.maximum(constant - expected, 0.0))
    assert (np.abs(got - expected) < 2e-5 + 1e-4 * deviations + 1e-6 * deviations**2).all()


@pytest.mark.interpreted
@pytest.mark.parametrize("name", CASES)
def test_only_the_block_is_weighed_and_nothing_above_the_constant(name: str, particles: ParticleSet) -> None:
    case = CASES[name]
    case.sensor.weigh(particles, 100, 1000, case.measurement)
    outside = np.r_[0:100, 1000:COUNT]
    assert (particles.log_weights[outside] == 0.0).all()
    assert (particles.log_weights[100:1000] < 2e-6).all()


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.outlier > 0.0])
def test_the_outlier_part_bounds_the_loss(name: str, particles: ParticleSet) -> None:
    case = CASES[name]
    particles.columns[:2] += 5e5
    constant = case.sensor.weigh(particles, 0, COUNT, case.measurement)
    assert (particles.log_weights + constant > math.log(case.sensor.outliers * case.outlier) - 1e-4).all()


CENTRE = {"north": 3.0, "east": 4.0, "heading": math.pi / 2, "scale": 2.0, "bias": 0.5, "delay": 0.2}


@pytest.mark.parametrize(
    ("sensor", "measurement", "innovation"),
    [
        (Range(1.0), RangeMeasurement(6.0, 0.0, 0.0), 1.0),
        (Range(1.0, scale="scale", bias="bias"), RangeMeasurement(6.0, 3.0, 4.0, 2.0), 1.5),
        (Position(1.0), PositionMeasurement(0.0, 0.0), 5.0),
        (Position(1.0, lever=(1.0, 2.0)), PositionMeasurement(1.0, 5.0), 0.0),
        (Position(1.0, delay="delay"), PositionMeasurement(3.0, 3.5, speed=2.5), 0.0),
        (Position(1.0, delay="delay"), PositionMeasurement(3.5, 4.0, speed=2.5, yaw_rate=-5 * math.pi), 0.0),
        (Velocity(1.0), VelocityMeasurement(0.0, 3.0, 1.0), 2.0),
        (Velocity(1.0, delay="delay"), VelocityMeasurement(1.0, 0.0, 1.0, None, 2.5 * math.pi), 0.0),
        (Velocity(1.0, scale="scale"), VelocityMeasurement(0.0, 3.0, 1.0), 1.0),
        (Heading(1.0), HeadingMeasurement(math.pi / 2 + 0.1 - 4 * math.pi), 0.1),
        (Heading(1.0, bias="bias"), HeadingMeasurement(math.pi / 2), -0.5),
    ],
)
def test_innovation(sensor: Any, measurement: Any, innovation: float) -> None:
    assert sensor.innovation(CENTRE, measurement) == pytest.approx(innovation, abs=1e-9)


@pytest.mark.parametrize(
    ("sensor", "measurement", "what"),
    [
        (Range(1.0, longest=50.0), RangeMeasurement(50.1, 0.0, 0.0), "distance"),
        (Range(1.0), RangeMeasurement(0.0, 0.0, 0.0), "distance"),
        (Range(1.0), RangeMeasurement(1.0, 0.0, 0.0, 0.0, 0.0), "sigma"),
        (Position(1.0), PositionMeasurement(0.0, 0.0, -1.0), "sigma"),
        (Position(1.0), PositionMeasurement(0.0, 0.0, 1.0, 0.0), "sigma"),
        (Velocity(1.0, span=20.0), VelocityMeasurement(11.0, 0.0, 1.0), "velocity"),
        (Velocity(1.0), VelocityMeasurement(1.0, 0.0, 1.0, 0.0), "sigma"),
        (Heading(1.0), HeadingMeasurement(1.0, 0.0), "sigma"),
    ],
)
def test_refusals(sensor: Any, measurement: Any, what: str) -> None:
    assert what in (sensor.refusal(measurement) or "")


@pytest.mark.parametrize(
    ("make", "what"),
    [
        (lambda: Range(0.0), "sigma"),
        (lambda: Range(1.0, outliers=1.0), "outliers"),
        (lambda: Range(1.0, span=math.inf), "span"),
        (lambda: Range(1.0, longest=0.0), "longest"),
        (lambda: Position(math.nan), "sigma"),
        (lambda: Position(1.0, lever=(math.nan, 0.0)), "lever"),
        (lambda: Velocity(-1.0), "sigma"),
        (lambda: Heading(1.0, outliers=-0.1), "outliers"),
    ],
)
def test_parameters_out_of_range(make: Callable[[], object], what: str) -> None:
    with pytest.raises(ValueError, match=what):
        make()


def test_a_slow_state_that_is_not_there(particles: ParticleSet) -> None:
    with pytest.raises(KeyError, match="range_bias"):
        Range(1.0, bias="range_bias").weigh(particles, 0, COUNT, RangeMeasurement(1.0, 0.0, 0.0))
