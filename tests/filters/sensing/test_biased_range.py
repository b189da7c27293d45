"""Biased ranges against their densities by scipy, and against Kalman filters where the problem is linear."""

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
from filters.sensing.biased_range import BiasedRange, BiasedRangeMeasurement

NAMES = ("north", "east", "heading", "scale", "bias/7", "down")
COUNT = 2000


def some_particles(bias_variance: float) -> ParticleSet:
    rng = np.random.default_rng(1)
    particles = ParticleSet(NAMES, COUNT)
    particles.count = COUNT
    particles.columns[:] = rng.normal(0.0, 3.0, (len(NAMES), COUNT))
    particles.columns[3] = rng.normal(1.0, 0.05, COUNT)
    particles.columns[4] = rng.normal(0.2, 0.3, COUNT)
    particles.variances["bias/7"] = bias_variance
    return particles


@pytest.mark.interpreted
@pytest.mark.parametrize("nlos", [0.0, 0.2])
@pytest.mark.parametrize("outliers", [0.0, 0.1])
@pytest.mark.parametrize("beacon", [7, 8, None])
@pytest.mark.parametrize("height", [None, "down"])
def test_the_likelihood_is_the_sum_of_its_parts(
    nlos: float, outliers: float, beacon: int | None, height: str | None
) -> None:
    sensor = BiasedRange(
        0.8, outliers, 100.0, "scale", {7: "bias/7"}, nlos=nlos, nlos_length=2.0, height=height
    )
    particles = some_particles(0.09)
    before = particles.columns.astype(np.float64)
    measurement = BiasedRangeMeasurement(9.0, 8.0, -3.0, 1.5, 0.5, beacon)
    constant = sensor.weigh(particles, 0, COUNT, measurement)

    down = (before[5] if height else 0.0) - 1.5
    expected = before[3] * np.sqrt((before[0] - 8.0) ** 2 + (before[1] + 3.0) ** 2 + down**2)
    known = beacon == 7
    residual = 9.0 - expected - (before[4] if known else 0.0)
    total = 0.25 + (0.09 if known else 0.0)
    hit = (1 - outliers - nlos) * stats.norm.pdf(residual, 0.0, math.sqrt(total))
    other = outliers / 100.0 + nlos * stats.expon.pdf(residual, scale=2.0)
    wanted = np.log(hit + other)
    seen = wanted > -60.0
    np.testing.assert_allclose(particles.log_weights[seen] + constant, wanted[seen], rtol=2e-4, atol=2e-4)
    assert particles.log_weights.max() < 1e-4
    learned = hit / (hit + other) * (0.09 / total) * residual if known else 0.0 * residual
    np.testing.assert_allclose(particles.columns[4], before[4] + learned, atol=2e-5, rtol=1e-4)
    np.testing.assert_array_equal(
        particles.columns[[0, 1, 2, 3, 5]], before[[0, 1, 2, 3, 5]].astype(np.float32)
    )


def filter_of(count: int, learned: list[Learned], seed: int = 3) -> ParticleFilter[Any]:
    return ParticleFilter(ConstantVelocity(0.0, 0.0), capacity=count, seed=seed, slow=learned)


def test_on_a_known_path_the_bias_is_a_kalman_filters() -> None:
    """Every particle is where the vehicle is, so nothing is sampled: mean and variance to five digits."""
    belief = filter_of(50, [Learned("bias/7", 0.05, 0.4)])
    belief.initialize({name: np.zeros(50) for name in belief.names})
    sensor = BiasedRange(0.3, outliers=0.0, biases={7: "bias/7"})
    oracle = KalmanFilter(np.zeros(1), np.array([[0.16]]))
    rng = np.random.default_rng(4)
    row = belief.names.index("bias/7")
    for distance in rng.normal(5.25, 0.3, 30):
        belief.predict(FREE, 0.1)
        oracle.predict(np.eye(1), np.array([[0.05**2 * 0.1]]))
        belief.weigh(sensor, BiasedRangeMeasurement(distance, 3.0, 4.0, 0.0, None, 7))
        oracle.correct(np.array([distance - 5.0]), np.eye(1), np.array([[0.09]]))
        moments = belief.moments()
        assert moments.mean[row] == pytest.approx(oracle.mean[0], abs=1e-5)
        assert moments.variance[row] == pytest.approx(oracle.covariance[0, 0], rel=1e-5)


def test_beside_an_unknown_place_the_bias_is_a_kalman_filters() -> None:
    """Two beacons 2 km off on one line: linear to 1 mm. 40,000 particles; means to 0.05 standard deviations,
    covariances to 8 %."""
    count = 40_000
    names = ("north", "bias/1", "bias/2")
    belief = filter_of(count, [Learned("bias/1", 0.0, 0.5), Learned("bias/2", 0.0, 0.2)])
    rng = np.random.default_rng(5)
    belief.initialize(
        {name: np.zeros(count) for name in belief.names} | {"north": rng.normal(0.0, 1.0, count)}
    )
    sensor = BiasedRange(0.4, outliers=0.0, biases={1: "bias/1", 2: "bias/2"})
    oracle = KalmanFilter(np.zeros(3), np.diag([1.0, 0.25, 0.04]))
    for turn in range(12):
        beacon = 1 + turn % 2
        north, sign = (2000.0, -1.0) if beacon == 1 else (-2000.0, 1.0)
        distance = 2000.0 + sign * 0.6 + (0.4, -0.1)[beacon - 1] + rng.normal(0.0, 0.4)
        belief.weigh(sensor, BiasedRangeMeasurement(distance, north, 0.0, 0.0, None, beacon))
        row = np.array([[sign, float(beacon == 1), float(beacon == 2)]])
        oracle.correct(np.array([distance - 2000.0]), row, np.array([[0.16]]))
        if turn % 4 == 3:
            belief.resample()
    found = belief.joint(names)
    spread = np.sqrt(np.diag(oracle.covariance))
    assert (np.abs(found.mean - oracle.mean) < 0.05 * spread).all()
    np.testing.assert_allclose(
        found.covariance / np.outer(spread, spread), oracle.covariance / np.outer(spread, spread), atol=0.08
    )


def test_an_outlier_teaches_no_bias() -> None:
    belief = filter_of(100, [Learned("bias/7", 0.0, 0.2)])
    belief.initialize({name: np.zeros(100) for name in belief.names})
    sensor = BiasedRange(0.3, outliers=0.05, biases={7: "bias/7"})
    belief.weigh(sensor, BiasedRangeMeasurement(25.0, 3.0, 4.0, 0.0, None, 7))
    moments = belief.moments()
    row = belief.names.index("bias/7")
    assert moments.mean[row] == pytest.approx(0.0, abs=1e-6)
    assert moments.variance[row] == pytest.approx(0.04, rel=1e-3)


def test_a_long_range_is_taken_for_blocked_and_a_short_one_is_not() -> None:
    """The evidence of 3 m too long lies above that of 3 m too short by the tail, and the belief hardly moves by it."""
    evidence: list[float] = []
    for distance in (8.0, 2.0):
        belief = filter_of(100, [])
        belief.initialize({name: np.zeros(100) for name in belief.names})
        sensor = BiasedRange(0.3, outliers=0.01, nlos=0.2, nlos_length=1.5)
        evidence.append(belief.weigh(sensor, BiasedRangeMeasurement(distance, 3.0, 4.0)).log_mean)
    assert evidence[0] == pytest.approx(math.log(0.2 * math.exp(-2.0) / 1.5 + 0.01 / 200.0), abs=1e-3)
    assert evidence[1] == pytest.approx(math.log(0.01 / 200.0), abs=1e-3)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ({"sigma": 0.0}, "sigma"),
        ({"sigma": 1.0, "nlos": 0.96}, "nlos"),
        ({"sigma": 1.0, "nlos": -0.1}, "nlos"),
        ({"sigma": 1.0, "nlos_length": 0.0}, "nlos_length"),
        ({"sigma": 1.0, "longest": math.inf}, "longest"),
    ],
)
def test_what_cannot_be_is_refused(arguments: dict[str, Any], word: str) -> None:
    with pytest.raises(ValueError, match=word):
        BiasedRange(**arguments)


def test_a_measurement_that_cannot_be_used_is_refused() -> None:
    sensor = BiasedRange(0.3, longest=50.0)
    assert "distance" in (sensor.refusal(BiasedRangeMeasurement(51.0, 0.0, 0.0)) or "")
    assert "sigma" in (sensor.refusal(BiasedRangeMeasurement(1.0, 0.0, 0.0, 0.0, 0.0)) or "")
    assert sensor.refusal(BiasedRangeMeasurement(1.0, 0.0, 0.0)) is None


def test_the_innovation_knows_scale_bias_and_height() -> None:
    sensor = BiasedRange(0.3, scale="scale", biases={7: "bias/7"}, height="down")
    centre = {"north": 0.0, "east": 0.0, "scale": 1.1, "bias/7": 0.2, "down": -2.0}
    measurement = BiasedRangeMeasurement(9.0, 3.0, 6.0, 0.0, None, 7)
    assert sensor.innovation(centre, measurement) == pytest.approx(9.0 - 1.1 * 7.0 - 0.2)
