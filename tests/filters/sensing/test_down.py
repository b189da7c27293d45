"""A height against its density by scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from filters.particle_set import ParticleSet
from filters.sensing.down import Down, DownMeasurement


@pytest.mark.interpreted
@pytest.mark.parametrize("measurement", [DownMeasurement(1.0), DownMeasurement(-2.0, 0.7)])
def test_the_likelihood_is_the_density(measurement: DownMeasurement) -> None:
    """Of a normal and a uniform part, to 2e-5."""
    particles = ParticleSet(("north", "east", "heading", "down"), 500)
    particles.count = 500
    particles.columns[3] = np.random.default_rng(1).normal(0.0, 3.0, 500)
    constant = Down(0.5, 0.1, 50.0).weigh(particles, 0, 500, measurement)
    sigma = measurement.sigma or 0.5
    down = particles.columns[3].astype(np.float64)
    wanted = np.log(0.9 * stats.norm.pdf(measurement.down, down, sigma) + 0.1 / 50.0)
    np.testing.assert_allclose(particles.log_weights + constant, wanted, rtol=2e-5, atol=2e-5)


def test_refusal_and_innovation() -> None:
    assert "sigma" in (Down().refusal(DownMeasurement(1.0, -1.0)) or "")
    assert Down().refusal(DownMeasurement(1.0)) is None
    assert Down().innovation({"down": -1.0}, DownMeasurement(1.5)) == 2.5
    with pytest.raises(ValueError, match="sigma"):
        Down(0.0)
