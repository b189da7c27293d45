"""The worked example of docs/sensor-model.md: it runs, and it is right."""

from __future__ import annotations

import importlib
import math
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from filters.motion import Unicycle
from filters.particle import ParticleFilter
from filters.particle_set import ParticleSet
from filters.sensing import Sensor

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "docs" / "examples" / "bearing.py"


@pytest.fixture(scope="module")
def example() -> Iterator[ModuleType]:
    """Import it by a name that the script could import too: numba's cache of its kernel remembers the name."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(EXAMPLE.parent)
        yield importlib.import_module("bearing")


def some_particles(count: int) -> ParticleSet:
    rng = np.random.default_rng(4)
    particles = ParticleSet(("north", "east", "heading"), count)
    particles.count = count
    particles.columns[:] = (
        rng.normal(0.0, 20.0, count),
        rng.normal(0.0, 20.0, count),
        rng.uniform(-math.pi, math.pi, count),
    )
    return particles


@pytest.mark.parametrize("outliers", [0.0, 0.05, 0.5])
@pytest.mark.parametrize("bearing", [0.0, -2.5, 7.0])
def test_the_log_likelihood_is_the_mixture(example: ModuleType, outliers: float, bearing: float) -> None:
    """Against the arc tangent and numpy's Bessel function, in float64."""
    sigma, place = 0.2, (12.0, -5.0)
    particles = some_particles(2000)
    measurement = example.BearingMeasurement(bearing, *place)
    constant = example.Bearing(sigma, outliers).weigh(particles, 0, 2000, measurement)

    north, east, heading = particles.columns.astype(np.float64)
    difference = bearing - (np.arctan2(place[1] - east, place[0] - north) - heading)
    concentration = 1.0 / sigma**2
    von_mises = np.exp(concentration * np.cos(difference)) / (2.0 * math.pi * np.i0(concentration))
    density = (1.0 - outliers) * von_mises + outliers / (2.0 * math.pi)
    expected = np.log(density)
    found = constant + particles.log_weights.astype(np.float64)
    np.testing.assert_allclose(found, expected, rtol=2e-6, atol=2e-3)


def test_a_particle_on_the_landmark_loses_nothing_but_a_reading(example: ModuleType) -> None:
    """There the direction is undefined; the weight must stay a number."""
    particles = some_particles(1)
    particles.columns[:2] = 0.0
    example.Bearing(0.05).weigh(particles, 0, 1, example.BearingMeasurement(1.0, 0.0, 0.0))
    assert -20.0 < particles.log_weights[0] <= 1e-5


def test_the_innovation_wraps(example: ModuleType) -> None:
    centre = {"north": 0.0, "east": 0.0, "heading": -3.0}
    measurement = example.BearingMeasurement(-3.1, 0.0, 10.0)  # expected: pi/2 + 3
    innovation = example.Bearing(0.05).innovation(centre, measurement)
    assert innovation == pytest.approx(-3.1 - (math.pi / 2 + 3.0) + 4.0 * math.pi - 2.0 * math.pi)


def test_what_is_refused(example: ModuleType) -> None:
    sensor: Sensor = example.Bearing(0.05)
    assert sensor.refusal(example.BearingMeasurement(3.0, 0.0, 0.0)) is None
    assert "two turns" in str(sensor.refusal(example.BearingMeasurement(400.0, 0.0, 0.0)))
    with pytest.raises(ValueError, match="at most"):
        example.Bearing(0.5)


def test_it_binds_to_a_particle_filter(example: ModuleType) -> None:
    belief = ParticleFilter(Unicycle(0.1, 0.1, 0.0, 0.0), capacity=500, seed=1)
    rng = np.random.default_rng(2)
    belief.initialize(
        {"north": rng.normal(0, 1, 500), "east": rng.normal(0, 1, 500), "heading": rng.normal(0, 0.1, 500)}
        | {"gyro_bias": np.zeros(500), "odometry_scale": np.ones(500)}
    )
    evidence = belief.weigh(example.Bearing(0.05), example.BearingMeasurement(0.1, 30.0, 0.0))
    assert evidence.accepted
    assert evidence.innovation == pytest.approx(0.1, abs=0.05)
    refused = belief.weigh(example.Bearing(0.05), example.BearingMeasurement(99.0, 30.0, 0.0))
    assert not refused.accepted


def test_the_script_finds_its_way() -> None:
    """Mean within 0.6 m and 0.06 rad of the truth for its seed; twelve other seeds stayed within 0.33 m."""
    done = subprocess.run([sys.executable, EXAMPLE], capture_output=True, text=True, check=True, timeout=120)
    figures = re.findall(r"(\w+): truth +(\S+), mean +(\S+)", done.stdout)
    assert [name for name, _, _ in figures] == ["north", "east", "heading"]
    for (_, truth, mean), bound in zip(figures, (0.6, 0.6, 0.06), strict=True):
        assert abs(float(truth) - float(mean)) < bound
