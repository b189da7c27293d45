"""Altitudes against their density by scipy, and against a Kalman filter where the problem is linear."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy import stats

from filters.kalman import KalmanFilter
from filters.motion import FREE, ConstantVelocity
from filters.motion.learned import Learned
from filters.particle import ParticleFilter
from filters.particle_set import ParticleSet
from filters.sensing.altitude import Altitude, AltitudeMeasurement

COUNT = 2000
NAMES = ("north", "east", "heading", "down", "weather")


def some_particles(variance: float) -> ParticleSet:
    rng = np.random.default_rng(1)
    particles = ParticleSet(NAMES, COUNT)
    particles.count = COUNT
    particles.columns[:] = rng.normal(0.0, 3.0, (len(NAMES), COUNT))
    particles.columns[3] -= 50.0
    particles.variances["weather"] = variance
    return particles


@pytest.mark.interpreted
@pytest.mark.parametrize("outliers", [0.0, 0.1])
@pytest.mark.parametrize("bias", [None, "weather"])
def test_the_likelihood_is_the_sum_of_its_parts(outliers: float, bias: str | None) -> None:
    sensor = Altitude(0.9, outliers, 400.0, bias)
    particles = some_particles(4.0)
    before = particles.columns.astype(np.float64)
    constant = sensor.weigh(particles, 0, COUNT, AltitudeMeasurement(49.0, 0.5))
    total = 0.25 + (4.0 if bias else 0.0)
    residual = 49.0 + before[3] - (before[4] if bias else 0.0)
    hit = (1.0 - outliers) * stats.norm.pdf(residual, 0.0, math.sqrt(total))
    wanted = np.log(hit + outliers / 400.0)
    seen = wanted > -60.0
    assert seen.sum() > 1000
    np.testing.assert_allclose(particles.log_weights[seen] + constant, wanted[seen], rtol=2e-4, atol=2e-4)
    assert particles.log_weights.max() < 1e-4
    share = hit / (hit + outliers / 400.0 + 1e-300)
    taught = share * 4.0 / total * residual if bias else 0.0
    np.testing.assert_allclose(particles.columns[4], before[4] + taught, atol=1e-4, rtol=1e-4)
    np.testing.assert_array_equal(particles.columns[:4], before[:4].astype(np.float32))


def test_only_the_block_is_weighed() -> None:
    particles = some_particles(1.0)
    Altitude(1.0, bias="weather").weigh(particles, 100, 200, AltitudeMeasurement(50.0))
    assert not particles.log_weights[:100].any()
    assert particles.log_weights[100:200].all()
    assert not particles.log_weights[200:].any()


def filter_of(count: int) -> ParticleFilter[Any]:
    motion = ConstantVelocity(0.0, 0.0, 3)
    return ParticleFilter(motion, capacity=count, seed=3, slow=[Learned("weather", 0.05, 100.0)])


def test_a_first_pressure_tells_the_weather_and_no_height() -> None:
    """With 100 m of unknown weather 30,000 particles, spread by 2 m, keep their spread to 2 % (a chi-square's quarter
    of its sigma), and each one's own weather is what is left of the reading."""
    belief = filter_of(30_000)
    rng = np.random.default_rng(2)
    down = rng.normal(-20.0, 2.0, 30_000)
    belief.initialize({name: np.zeros(30_000) for name in belief.names} | {"down": down})
    belief.weigh(Altitude(0.3, outliers=0.0, bias="weather"), AltitudeMeasurement(95.0))
    moments = belief.moments()
    row = moments.names.index("down")
    assert math.sqrt(moments.variance[row]) == pytest.approx(2.0, rel=0.02)
    np.testing.assert_allclose(belief.column("weather"), 95.0 + down, atol=0.01)


def test_beside_fixes_it_is_a_kalman_filter() -> None:
    """Down and weather, told by turns by fixes and by the barometer: means to 0.06 of their standard deviation,
    standard deviations to 5 %. 40,000 particles."""
    count = 40_000
    belief = filter_of(count)
    rng = np.random.default_rng(5)
    start = {name: np.zeros(count) for name in belief.names} | {"down": rng.normal(0.0, 2.0, count)}
    belief.initialize(start)
    barometer, fix = Altitude(0.3, outliers=0.0, bias="weather"), Altitude(1.0, outliers=0.0)
    oracle = KalmanFilter(np.zeros(2), np.diag([4.0, 1e4]))
    for turn in range(12):
        belief.predict(FREE, 0.5)
        oracle.predict(np.eye(2), np.diag([0.0, 0.05**2 * 0.5]))
        up = 1.5 + rng.normal(0.0, 0.3) + 80.0
        belief.weigh(barometer, AltitudeMeasurement(up))
        oracle.correct(np.array([up]), np.array([[-1.0, 1.0]]), np.array([[0.09]]))
        if turn % 3 == 2:
            up = 1.5 + rng.normal(0.0, 1.0)
            belief.weigh(fix, AltitudeMeasurement(up))
            oracle.correct(np.array([up]), np.array([[-1.0, 0.0]]), np.array([[1.0]]))
            belief.resample()
    found = belief.moments()
    rows = [found.names.index(name) for name in ("down", "weather")]
    spread = np.sqrt(np.diag(oracle.covariance))
    assert (np.abs(found.mean[rows] - oracle.mean) < 0.06 * spread).all()
    np.testing.assert_allclose(np.sqrt(found.variance[rows]), spread, rtol=0.05)


def test_an_outlier_teaches_no_bias() -> None:
    belief = ParticleFilter(
        ConstantVelocity(0.0, 0.0, 3), capacity=50, seed=1, slow=[Learned("weather", 0.0, 0.5)]
    )
    belief.initialize({name: np.zeros(50) for name in belief.names})
    belief.weigh(Altitude(0.3, bias="weather"), AltitudeMeasurement(60.0))
    moments = belief.moments()
    row = moments.names.index("weather")
    assert moments.mean[row] == pytest.approx(0.0, abs=1e-5)
    assert moments.variance[row] == pytest.approx(0.25, rel=1e-3)


def test_the_innovation_is_of_the_centre() -> None:
    centre = {"down": -12.0, "weather": 2.0}
    assert Altitude(1.0, bias="weather").innovation(centre, AltitudeMeasurement(15.0)) == pytest.approx(1.0)
    assert Altitude(1.0).innovation(centre, AltitudeMeasurement(15.0)) == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [((0.0, 0.1, 9.0), "sigma"), ((1.0, 1.0, 9.0), "outliers"), ((1.0, 0.1, 0.0), "span")],
)
def test_parameters_out_of_range_are_refused(arguments: tuple[float, float, float], word: str) -> None:
    with pytest.raises(ValueError, match=word):
        Altitude(*arguments)
    assert "sigma" in (Altitude(1.0).refusal(AltitudeMeasurement(1.0, -1.0)) or "")
    with pytest.raises(KeyError, match="weather"):
        Altitude(1.0, bias="weather").weigh(ParticleSet(NAMES[:4], 4), 0, 4, AltitudeMeasurement(1.0))
