"""Exercises 2 and 5 against quadrature over the plane, and the extended Kalman filter against its closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import integrate, stats

from filters.sensing import Sensor
from filters.textbook import ring, ring_histogram
from filters.textbook.projection import Projection, ProjectionMeasurement


def test_the_density_is_the_integral_over_the_heading() -> None:
    for x, y in ((1.0, 0.0), (0.3, -0.9), (0.0, 0.0), (1.2, 0.4)):
        spread = math.sqrt(ring.VARIANCE)

        def given(heading: float, x: float = x, y: float = y, spread: float = spread) -> float:
            return float(
                stats.norm.pdf(x, math.cos(heading), spread) * stats.norm.pdf(y, math.sin(heading), spread)
            )

        expected, _ = integrate.quad(given, -math.pi, math.pi, points=[math.atan2(y, x)], epsabs=1e-13)
        assert float(ring.density(x, y)) == pytest.approx(expected / (2.0 * math.pi), rel=1e-9, abs=1e-20)


@pytest.mark.parametrize("measured", [0.5, -0.9, 1.1])
def test_the_exact_moments_are_those_of_the_densities(measured: float) -> None:
    """The mid-point rule over the plane; the density is smooth, so it has converged at 0.02 m."""
    side = np.arange(-2.0, 2.0, 0.02) + 0.01
    x, y = np.meshgrid(side, side, indexing="ij")
    exact = ring.exact(measured)
    for row, density in enumerate((ring.density(x, y), ring.posterior(x, y, measured))):
        mass = density * 0.02**2
        assert mass.sum() == pytest.approx(1.0, abs=1e-9)
        mean = np.array([(mass * x).sum(), (mass * y).sum()])
        np.testing.assert_allclose(exact.means[row], mean, atol=1e-9)
        away = np.stack((x - mean[0], y - mean[1]))
        np.testing.assert_allclose(
            exact.covariances[row], np.einsum("ikl,jkl,kl->ij", away, away, mass), atol=1e-9
        )
    evidence = (ring.density(x, y) * stats.norm.pdf(measured, x, math.sqrt(ring.NOISE))).sum() * 0.02**2
    assert exact.log_evidence == pytest.approx(math.log(evidence), abs=1e-9)


def test_the_extended_kalman_filter_takes_the_ring_for_a_line() -> None:
    found = ring.extended()
    np.testing.assert_allclose(found.means, [[1.0, 0.0], [0.75, 0.0]], atol=1e-12)
    np.testing.assert_allclose(found.covariances[0], np.diag([0.01, 10_000.01]), rtol=1e-12)
    np.testing.assert_allclose(found.covariances[1], np.diag([0.005, 10_000.01]), rtol=1e-12)
    assert found.log_evidence == pytest.approx(stats.norm.logpdf(0.5, 1.0, math.sqrt(0.02)), rel=1e-12)


def test_the_histogram_has_two_places_and_the_exact_shares() -> None:
    exact, found = ring.exact(), ring_histogram.histogram(0.1, 64)
    assert (found.distances < 0.06).all()
    np.testing.assert_allclose(found.moments.means, exact.means, atol=0.01)
    np.testing.assert_allclose(found.moments.covariances, exact.covariances, atol=0.03)
    assert found.moments.log_evidence == pytest.approx(exact.log_evidence, abs=0.05)
    assert found.corrected[:, found.grid.shape[1] // 2 :].sum() == pytest.approx(0.5, abs=1e-9)


def test_headings_too_coarse_leave_gaps() -> None:
    found = ring_histogram.resolution((0.1,), (8, 32))
    assert found.cells.tolist() == [[32 * 32 * 8, 32 * 32 * 32]]
    assert found.distances[0, 0, 0] > 3.0 * found.distances[0, 1, 0]


def test_particles_agree_with_the_exact_belief() -> None:
    """50,000 particles, effective about 6,500 after z: five standard errors; false alarm below 1e-4."""
    exact, found = ring.exact(), ring.particles(50_000, seed=3)
    for row, size in ((0, found.count), (1, found.effective_sample_size)):
        error = 5.0 * np.sqrt(np.diag(exact.covariances[row]) / size)
        np.testing.assert_array_less(np.abs(found.moments.means[row] - exact.means[row]), error)
        np.testing.assert_allclose(found.moments.covariances[row], exact.covariances[row], atol=0.05)
    assert found.upper == pytest.approx(0.5, abs=5.0 * 0.5 / math.sqrt(found.effective_sample_size))
    # the evidence is taken over at most 2,048 particles: five of its standard errors are 0.2
    assert found.moments.log_evidence == pytest.approx(exact.log_evidence, abs=0.2)


def test_few_particles_lose_a_place() -> None:
    """Twelve of 30 runs with 25 particles did; each has a chance of about 0.4, so none has 2e-7."""
    found = ring.convergence(30, (25, 1_600))
    assert found.lost[0] > 0.0
    assert found.lost[1] == 0.0
    assert found.mean_errors[0] > 3.0 * found.mean_errors[1]
    assert found.upper_errors[0] > 3.0 * found.upper_errors[1]


def test_the_projection_is_a_sensor() -> None:
    sensor: Sensor[ProjectionMeasurement] = Projection(0.25)
    measurement = ProjectionMeasurement(2.0)
    assert sensor.refusal(measurement) is None
    assert sensor.innovation({"north": 0.5}, measurement) == 1.5
    for wrong in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match="variance"):
            Projection(wrong)
