"""A velocity beside particles that have one: the closed form, the Kalman filter, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from filters.linearised.free_velocity import LinearisedFreeVelocity
from filters.motion.constant_velocity import (
    FREE,
    VELOCITY_EAST,
    VELOCITY_NORTH,
    ConstantVelocity,
    FreeControl,
)
from filters.particle import ParticleFilter
from filters.sensing.free_velocity import FreeVelocity, FreeVelocityMeasurement

COUNT = 20_000


def belief_of(motion: ConstantVelocity, count: int = COUNT) -> ParticleFilter[FreeControl]:
    """Return particles about the origin whose velocities are drawn with 1 m/s."""
    belief = ParticleFilter(motion, capacity=count, seed=4)
    random = np.random.default_rng(7)
    belief.initialize({name: random.standard_normal(count) for name in motion.names})
    return belief


def test_the_likelihood_is_a_normal_s_and_an_outlier_s() -> None:
    """Against scipy, with the variance that the path leaves open in it."""
    belief = belief_of(ConstantVelocity(0.5), 500)
    evidence = belief.weigh(
        FreeVelocity(0.3, outliers=0.1, span=50.0), FreeVelocityMeasurement(1.2, -0.4, 0.4, 0.09)
    )
    north, east = belief.column(VELOCITY_NORTH), belief.column(VELOCITY_EAST)
    spread = float(np.hypot(0.4, 0.3))
    density = 0.9 * norm.pdf(1.2, north, spread) * norm.pdf(-0.4, east, spread) + 0.1 / 2500.0
    np.testing.assert_allclose(belief.weights / belief.weights.max(), density / density.max(), rtol=2e-4)
    assert evidence.log_mean == pytest.approx(float(np.log(density.mean())), abs=1e-3)


def test_it_learns_as_a_kalman_filter_does() -> None:
    """After a second of motion and one velocity, the moments are the linear filter's, wide by what paths leave open.

    The mean is asked to four of its sigmas, the variance to four of the 1.4 / sqrt(n) that it scatters by.
    """
    motion = ConstantVelocity(0.5, 0.0)
    belief = belief_of(motion)
    for _ in range(10):
        belief.predict(FREE, 0.1)
    loose = motion.conditional_variances[VELOCITY_NORTH]
    prior = 1.0 + 0.25
    gain = prior / (prior + 0.16)
    belief.weigh(FreeVelocity(0.3, outliers=0.0), FreeVelocityMeasurement(1.0, 0.5, 0.4, loose))
    joint = belief.joint((VELOCITY_NORTH, VELOCITY_EAST))
    few = 4.0 * np.sqrt(0.16 * gain / belief.effective_sample_size)
    np.testing.assert_allclose(joint.mean, [gain, 0.5 * gain], atol=few)
    doubt = 4.0 * 0.16 * 1.4 / np.sqrt(belief.effective_sample_size)
    variances = np.diagonal(joint.covariance)
    assert np.all((variances > 0.16 * gain - doubt) & (variances < 0.16 * gain + loose + doubt))


def test_the_linearised_one_expects_the_same() -> None:
    names = ("north", "east", "heading", VELOCITY_NORTH, VELOCITY_EAST)
    mean = np.array([3.0, 4.0, 0.0, 1.5, -2.0])
    sensor, measurement = FreeVelocity(0.3), FreeVelocityMeasurement(2.5, -2.0)
    said = LinearisedFreeVelocity(sensor).expect({name: i for i, name in enumerate(names)}, mean, measurement)
    np.testing.assert_allclose(said.measured - said.expected, [1.0, 0.0])
    np.testing.assert_array_equal(said.jacobian, [[0, 0, 0, 1, 0], [0, 0, 0, 0, 1]])
    np.testing.assert_allclose(said.noise, 0.09 * np.eye(2))
    assert sensor.innovation(dict(zip(names, mean, strict=True)), measurement) == pytest.approx(1.0)


@pytest.mark.parametrize(
    "measurement",
    [
        FreeVelocityMeasurement(60.0, 0.0),
        FreeVelocityMeasurement(1.0, 0.0, 0.0),
        FreeVelocityMeasurement(1.0, 0.0, 0.1, -1.0),
    ],
)
def test_what_cannot_be_is_refused(measurement: FreeVelocityMeasurement) -> None:
    assert FreeVelocity(0.3).refusal(measurement) is not None
