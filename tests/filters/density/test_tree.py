"""The density tree of particles: every leaf has the weight of the particles in it, and none more than the bound."""

from __future__ import annotations

import math

import numpy as np
import pytest

from filters.density.histogram import Histograms
from filters.density.tree import Trees
from filters.tree_nodes import Side


def test_leaves_hold_what_lies_in_them() -> None:
    rng = np.random.default_rng(1)
    points, weights = rng.normal(size=(3000, 2)), rng.random(3000)
    tree = Trees(bound=0.02)(points, weights)
    for low, high, mass in zip(*tree.leaf_boxes, strict=True):
        inside = ((points >= low) & (points < high)).all(axis=1)
        assert mass == pytest.approx(float(weights[inside].sum() / weights.sum()), abs=1e-12)
        assert mass <= 0.02


def test_by_its_own_bound_it_is_smaller_than_a_histogram() -> None:
    """On two small places far apart: at least ten times fewer leaves than Scott's rule has cells."""
    rng = np.random.default_rng(2)
    points = rng.normal(size=(4000, 2))
    points[2000:] += 200.0
    sides = [Side(-5.0, 205.0, 0.2)] * 2
    tree = Trees(bound=0.02, sides=sides)(points)
    histogram = Histograms()(points * 1.0)
    fine = (210.0 / 0.5) ** 2
    assert tree.leaf_count * 10 < fine
    assert tree.evaluate([[100.0, 100.0]])[0] < 1e-4 * tree.evaluate([[0.0, 0.0]])[0]
    assert histogram.evaluate([[0.0, 0.0]])[0] < tree.evaluate([[0.0, 0.0]])[0]


def test_sides_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match="wrap"):
        Trees(sides=[Side(-math.pi, math.pi, 0.1, wraps=True)])([[1.0]])
    with pytest.raises(ValueError, match="bound"):
        Trees(bound=1.0)([[1.0], [2.0]])


def test_particles_that_are_all_alike_make_a_tree() -> None:
    tree = Trees()([[1.0, 0.5]] * 4, None, [False, True])
    assert np.isfinite(tree.evaluate([[1.0, 0.5]])).all()
