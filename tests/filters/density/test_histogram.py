"""The histogram of particles against numpy's."""

from __future__ import annotations

import math

import numpy as np
import pytest

from filters.density.histogram import Histograms, grid_about
from filters.density.weighted import weighted
from filters.grid import Axis, Grid, circle


def test_it_equals_numpy() -> None:
    rng = np.random.default_rng(1)
    points, weights = rng.normal(size=(2000, 2)), rng.random(2000)
    density = Histograms(Grid([Axis(-2.0, 2.0, 8), Axis(-3.0, 3.0, 5)]))(points, weights)
    edges = [np.linspace(-2.0, 2.0, 9), np.linspace(-3.0, 3.0, 6)]
    expected = np.histogramdd(points, edges, weights=weights, density=True)[0]
    middles = np.stack(np.meshgrid(*(0.5 * (e[1:] + e[:-1]) for e in edges), indexing="ij"), -1)
    np.testing.assert_allclose(density.evaluate(middles.reshape(-1, 2)), expected.reshape(-1), rtol=1e-12)


def test_scotts_rule_in_one_dimension() -> None:
    points = np.random.default_rng(2).normal(size=(1000, 1))
    grid = grid_about(weighted("test", points, None, None))
    width = 3.49 * float(points.std()) * 1000.0 ** (-1.0 / 3.0)
    assert grid.size == math.ceil(float(np.ptp(points)) / width)


def test_the_grid_has_bounded_size() -> None:
    """One particle far away would ask for cells without number; there is one particle in the grid's corner."""
    points = np.random.default_rng(3).normal(size=(30_000, 4))
    points[0] = 1e4
    grid = grid_about(weighted("test", points, None, None))
    assert grid.size <= 1 << 22
    assert (grid.cell_of(points) >= 0).all()


def test_a_dimension_without_spread_is_one_cell() -> None:
    density = Histograms()([[1.0, 2.0], [3.0, 2.0]])
    assert density.grid.shape[1] == 1


def test_a_grid_that_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="wraps"):
        Histograms(Grid([circle(8)]))([[1.0]])
    with pytest.raises(ValueError, match="no particle"):
        Histograms(Grid([Axis(5.0, 6.0, 3)]))([[1.0]])
    with pytest.raises(ValueError, match="density tree"):
        Histograms()(np.zeros((3, 5)))
