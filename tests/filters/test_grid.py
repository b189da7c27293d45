"""Grids against counting by hand, and the moments of boxes against numeric integration."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import integrate

from filters.grid import Axis, Grid, box_moments, circle

GRID = Grid([Axis(-1.0, 2.0, 3), circle(4)])


def test_cells_are_numbered_row_by_row() -> None:
    states = np.column_stack(GRID.states_at(np.arange(GRID.size)))
    assert GRID.cell_of(states).tolist() == list(range(12))
    open_mesh = np.broadcast_arrays(*GRID.states())
    np.testing.assert_array_equal(np.column_stack([column.reshape(-1) for column in open_mesh]), states)
    assert GRID.volume == pytest.approx(math.pi / 2.0)


def test_a_point_outside_has_no_cell_and_an_angle_any() -> None:
    points = [[-1.01, 0.0], [2.0, 0.0], [-1.0, -math.pi], [-1.0, math.pi], [1.99, 5.0 * math.pi - 0.1]]
    assert GRID.cell_of(points).tolist() == [-1, -1, 0, 0, 11]


@pytest.mark.parametrize("points", [[[0.0]], [0.0, 0.0], [[0.0, math.nan]], [[math.inf, 0.0]]])
def test_points_that_make_no_sense_are_refused(points: list[float]) -> None:
    with pytest.raises(ValueError, match="grid"):
        GRID.cell_of(points)


@pytest.mark.parametrize(
    ("low", "high", "cells"), [(0.0, 0.0, 3), (math.nan, 1.0, 3), (0.0, math.inf, 3), (0, 1, 0)]
)
def test_an_axis_that_makes_no_sense_is_refused(low: float, high: float, cells: int) -> None:
    with pytest.raises(ValueError, match="axis"):
        Axis(low, high, cells)


@pytest.mark.parametrize("count", [0, 5])
def test_a_grid_has_one_to_four_axes(count: int) -> None:
    with pytest.raises(ValueError, match="1 to 4 axes"):
        Grid([circle(2)] * count)


def test_moments_of_boxes_equal_integrals() -> None:
    """A line of three boxes and a circle of three, the last of which lies across the seam."""
    centres = [np.array([0.0, 2.0, 5.0]), np.array([2.0, -2.5, 3.1])]
    widths = [np.array([1.0, 3.0, 0.5]), np.array([0.4, 0.8, 0.6])]
    masses = np.array([0.5, 1.0, 0.7])
    moments = box_moments(centres, widths, masses, np.array([math.inf, 2.0 * math.pi]))

    def mean(function: object, axis: int) -> float:
        parts = [
            mass * integrate.quad(function, c - w / 2, c + w / 2)[0] / w
            for mass, c, w in zip(masses, centres[axis], widths[axis], strict=True)
        ]
        return sum(parts) / masses.sum()

    middle = mean(lambda x: x, 0)
    assert moments.mean[0] == pytest.approx(middle, abs=1e-13)
    assert moments.covariance[0, 0] == pytest.approx(mean(lambda x: (x - middle) ** 2, 0), abs=1e-13)
    direction = math.atan2(mean(math.sin, 1), mean(math.cos, 1))
    assert moments.mean[1] == pytest.approx(direction, abs=1e-13)
    spread = mean(lambda x: math.remainder(x - direction, 2.0 * math.pi) ** 2, 1)
    assert moments.covariance[1, 1] == pytest.approx(spread, abs=1e-12)
    np.testing.assert_allclose(moments.covariance, moments.covariance.T)
