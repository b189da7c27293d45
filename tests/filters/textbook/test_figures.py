"""What figures 4.1 to 4.7 show: cells, trees, particles, importance factors and combs against what must come out."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import integrate

from filters.textbook import comb, histogram, importance, particles, partition, transform
from filters.textbook.error import root_mean_square


def test_the_histogram_counts_points_of_every_cell() -> None:
    """By hand: Gauss and Legendre's points of each cell of X, counted in the cells of Y by numpy."""
    found = histogram.histogram(10, 8)
    nodes, weights = np.polynomial.legendre.leggauss(8)
    width = np.diff(found.edges)[0]
    points = found.edges[:-1, None] + 0.5 * width * (nodes + 1.0)
    masses = found.before[:, None] * 0.5 * weights
    expected, _ = np.histogram(transform.function(points), found.edges, weights=masses)
    np.testing.assert_allclose(found.after, expected / expected.sum(), atol=1e-12)


def test_only_more_cells_and_more_points_together_converge() -> None:
    one, many = histogram.accuracy(1, (40, 320)), histogram.accuracy(32, (40, 320))
    assert one.density_errors[1] > 0.15
    assert many.density_errors[1] < 0.5 * many.density_errors[0]
    assert (many.cell_errors <= many.density_errors + 1e-12).all()


def test_the_density_error_is_the_integral() -> None:
    edges, probabilities = np.array([-1.0, 0.5, 1.2, 3.0]), np.array([0.2, 0.3, 0.5])

    y = np.arange(-1.0, 3.0, 1e-4) + 5e-5
    heights = (probabilities / np.diff(edges))[np.searchsorted(edges, y, side="right") - 1]
    inside = 1e-4 * float(np.abs(heights - transform.density(y)).sum())
    beyond = 1.0 - float(transform.cumulative(3.0) - transform.cumulative(-1.0))
    assert histogram.density_error(edges, probabilities) == pytest.approx(0.5 * (inside + beyond), abs=5e-3)


def test_the_tree_has_as_many_leaves_and_half_the_error() -> None:
    grid, tree = partition.grid(20), partition.tree(20)
    assert grid.depths.size == 20
    assert 15 <= tree.depths.size <= 20
    assert tree.error < 0.5 * grid.error
    for part in (grid, tree):
        assert part.edges[0] == partition.SPAN[0]
        assert part.edges[-1] == partition.SPAN[1]
        assert part.probabilities.sum() == pytest.approx(1.0, abs=1e-6)
    np.testing.assert_allclose(np.diff(tree.edges) * 2.0**tree.depths, 10.0)
    np.testing.assert_allclose(tree.probabilities, np.diff(transform.cumulative(tree.edges)), atol=0.02)
    assert partition.accuracy((10, 20)).tree_errors.shape == (2,)


def test_particles_come_out_as_y() -> None:
    """Kolmogorov and Smirnov's distance of 400 stays below 0.1 but for one seed in 2,000."""
    found = particles.passing(400)
    y = np.sort(found.y)
    assert np.abs((np.arange(400) + 0.5) / 400 - transform.cumulative(y)).max() < 0.1
    np.testing.assert_array_equal(found.y, transform.function(found.x))
    assert found.mean == pytest.approx(float(found.y.mean()))


def test_the_mean_of_particles_errs_as_theory_says() -> None:
    """Of 100 draws the root mean square has a relative error of 0.07: five of them; false alarm below 1e-5."""
    found = particles.variability(100, (25, 250))
    np.testing.assert_allclose(found.mean_errors, found.theory, rtol=0.35)
    assert found.density_errors[1] < found.density_errors[0]
    assert found.density_spreads[1] < found.density_spreads[0]


def test_kernel_densities_integrate_to_one() -> None:
    found = particles.draws(250, repetitions=2, points=801)
    step = found.y[1] - found.y[0]
    np.testing.assert_allclose(found.densities.sum(axis=1) * step, 1.0, atol=5e-3)


@pytest.mark.parametrize("name", list(importance.PROPOSALS))
def test_weighted_samples_err_as_the_delta_method_says(name: str) -> None:
    """400 repetitions: relative error 0.035; five of them, false alarm below 1e-5, above 1,000 samples."""
    found = importance.error(name, 400, (1_000, 3_000))
    np.testing.assert_allclose(found.errors, found.theory, rtol=0.18)
    assert (found.unweighted > 5.0 * found.errors).all()


def test_the_target_is_a_density_and_the_interval_its_integral() -> None:
    def target(x: float) -> float:
        return float(importance.target(x))

    total, _ = integrate.quad(target, -10.0, 20.0, points=[3.0, 6.0])
    inside, _ = integrate.quad(target, *importance.INTERVAL)
    assert total == pytest.approx(1.0, abs=1e-9)
    assert importance.probability() == pytest.approx(inside, abs=1e-12)


def test_resampled_particles_are_among_the_samples() -> None:
    found = importance.illustrate()
    assert set(found.resampled) <= set(found.samples)
    assert 1.0 < found.effective_sample_size < found.samples.size
    np.testing.assert_allclose(
        found.weights, importance.target(found.samples) / importance.proposal(found.samples)
    )


@pytest.mark.parametrize("uniform", [1e-9, 0.3, 0.62, 1.0])
def test_every_tooth_falls_on_its_particle(uniform: float) -> None:
    """Equation 4.37 by hand."""
    found = comb.comb(uniform)
    expected = [next(i for i, end in enumerate(found.ends) if end >= tooth - 1e-6) for tooth in found.teeth]
    assert found.ancestors.tolist() == expected
    count = found.teeth.size
    assert found.copies.sum() == count
    assert (np.abs(found.copies - count * found.weights) < 1.0 + 1e-6).all()
    assert found.offset == pytest.approx(uniform / count)


def test_the_root_mean_square() -> None:
    assert root_mean_square([3.0, -4.0]) == pytest.approx(math.sqrt(12.5))
