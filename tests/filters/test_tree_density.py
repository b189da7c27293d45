"""Density trees against counting, linear search and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from filters.density_tree import DensityTree, Side

SIDES = [Side(-8.0, 8.0, 0.1), Side(-math.pi, math.pi, 0.05, wraps=True)]


def particles(count: int, seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.normal(1.0, 0.8, count), rng.vonmises(3.0, 5.0, count)])


@pytest.fixture(scope="module")
def tree() -> DensityTree:
    return DensityTree.of_particles(SIDES, particles(20_000), 0.005)


def test_leaves_hold_the_weight_that_lies_in_them(tree: DensityTree) -> None:
    points = particles(20_000)
    low, high, mass = tree.leaf_boxes
    for k in range(tree.leaf_count):
        inside = ((points >= low[k]) & (points < high[k])).all(axis=1)
        assert mass[k] == pytest.approx(inside.mean(), abs=1e-12)
    assert mass.sum() == pytest.approx(1.0, abs=1e-12)


def test_a_box_is_split_if_and_only_if_it_exceeds_the_bound(tree: DensityTree) -> None:
    nodes = tree.nodes
    inner = nodes.axis >= 0
    assert (nodes.mass[inner] > 0.005).all()
    narrow = ((nodes.high - nodes.low) < 2.0 * np.array([0.1, 0.05]) * (1 - 1e-9)).all(axis=1)
    assert (nodes.mass[~inner & ~narrow] <= 0.005).all()


def test_weights_count_as_copies_do() -> None:
    points, copies = particles(300), np.random.default_rng(2).integers(0, 5, 300)
    one = DensityTree.of_particles(SIDES, points, 0.02, 7.0 * copies)
    other = DensityTree.of_particles(SIDES, np.repeat(points, copies, axis=0), 0.02)
    np.testing.assert_array_equal(one.nodes.low, other.nodes.low)
    np.testing.assert_allclose(one.nodes.mass, other.nodes.mass, atol=1e-12)


@pytest.mark.interpreted
def test_the_leaf_of_a_point_is_found_as_by_linear_search(tree: DensityTree) -> None:
    points = np.random.default_rng(3).uniform([-9.0, -9.0], [9.0, 9.0], (500, 2))
    low, high, mass = tree.leaf_boxes
    density = tree.evaluate(points)
    angle = np.mod(points[:, 1] + math.pi, 2.0 * math.pi) - math.pi
    for point, turned, found in zip(points, angle, density, strict=True):
        home = (
            (low[:, 0] <= point[0]) & (point[0] < high[:, 0]) & (low[:, 1] <= turned) & (turned < high[:, 1])
        )
        expected = (mass / (high - low).prod(axis=1))[home].sum()
        assert found == pytest.approx(expected, rel=1e-12)
        assert home.sum() == (1 if abs(point[0]) < 8.0 else 0)


def test_depth_is_that_of_the_deepest_leaf(tree: DensityTree) -> None:
    low, high, _ = tree.leaf_boxes
    halvings = np.log2((16.0 * 2.0 * math.pi) / (high - low).prod(axis=1))
    assert tree.depth == round(halvings.max())


def test_moments_approach_those_of_the_particles() -> None:
    points = particles(20_000)
    moments = DensityTree.of_particles(SIDES, points, 1e-3).moments()
    assert moments.mean[0] == pytest.approx(points[:, 0].mean(), abs=5e-3)
    assert moments.mean[1] == pytest.approx(stats.circmean(points[:, 1], math.pi, -math.pi), abs=5e-3)
    assert moments.covariance[0, 0] == pytest.approx(0.64, rel=0.03)


def test_the_density_approaches_the_true_one() -> None:
    """Total variation by Monte Carlo on the truth falls as particles and leaves grow."""
    truth = particles(4000, 9)
    exact = stats.norm(1.0, 0.8).pdf(truth[:, 0]) * stats.vonmises(5.0, loc=3.0).pdf(truth[:, 1])
    errors = [
        0.5
        * np.abs(DensityTree.of_particles(SIDES, particles(n), n**-0.5).evaluate(truth) / exact - 1.0).mean()
        for n in (500, 5000, 50_000)
    ]
    assert errors[0] > 1.3 * errors[1] > 1.3**2 * errors[2]


def test_draws_are_distributed_as_the_tree(tree: DensityTree) -> None:
    """Chi-square over the leaves; false alarm 1e-6."""
    drawn = tree.draw(100_000, np.random.default_rng(4))
    counts = np.bincount(tree.leaf_of(drawn), minlength=tree.nodes.axis.size)[tree.nodes.leaves]
    expected = tree.leaf_boxes[2] * len(drawn)
    statistic = ((counts - expected)[expected > 5] ** 2 / expected[expected > 5]).sum()
    assert statistic < stats.chi2.isf(1e-6, (expected > 5).sum())
    assert counts[expected == 0.0].sum() == 0


def test_no_leaf_is_wider_than_the_coarsest_even_if_empty() -> None:
    sides = [Side(0.0, 16.0, 0.1, 3.0), Side(0.0, 1.0, 0.1, 1.0)]
    uniform = DensityTree.uniform(sides)
    assert uniform.leaf_count == 8
    assert uniform.evaluate([[0.1, 0.1], [16.1, 0.1]]).tolist() == pytest.approx([1.0 / 16.0, 0.0])
    lone = DensityTree.of_particles(sides, [[1.0, 0.5]], 0.5)
    low, high, mass = lone.leaf_boxes
    assert (high - low)[:, 0].max() == 2.0
    assert (mass > 0.0).sum() == 1
    assert (high - low)[mass > 0.0][0].max() < 0.2


@settings(max_examples=50, deadline=None)
@given(
    st.lists(st.tuples(st.floats(-8.0, 7.99), st.floats(-50.0, 50.0)), min_size=1, max_size=40),
    st.floats(0.01, 0.9),
)
def test_any_particles_make_a_tree_that_sums_to_one(points: list[tuple[float, float]], bound: float) -> None:
    made = DensityTree.of_particles(SIDES, points, bound)
    low, high, mass = made.leaf_boxes
    assert mass.sum() == pytest.approx(1.0, abs=1e-12)
    assert (high - low).prod(axis=1).sum() == pytest.approx(32.0 * math.pi)
    assert (made.evaluate(points) > 0.0).all()
    assert (made.evaluate(made.draw(20, np.random.default_rng(1))) > 0.0).all()


@pytest.mark.parametrize(
    ("points", "bound", "weights", "message"),
    [
        ([[0.0]], 0.1, None, "points"),
        ([[0.0, math.nan]], 0.1, None, "finite"),
        ([[9.0, 0.0]], 0.1, None, "no particle"),
        ([[0.0, 0.0]], 0.0, None, "bound"),
        ([[0.0, 0.0]], 1.0, None, "bound"),
        ([[0.0, 0.0]], 0.1, [-1.0], "weights"),
        ([[0.0, 0.0]], 0.1, [1.0, 1.0], "weights"),
        ([[0.0, 0.0]], 0.1, [0.0], "no particle"),
    ],
)
def test_particles_that_make_no_sense_are_refused(
    points: object, bound: float, weights: object, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        DensityTree.of_particles(SIDES, points, bound, weights)


def test_a_negative_count_is_refused(tree: DensityTree) -> None:
    with pytest.raises(ValueError, match="count"):
        tree.draw(-1, np.random.default_rng(1))
