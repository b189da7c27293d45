"""Rays through a grid against the intersection of each ray with each cell, one by one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from filters.kernels.raycast import FREE, HIT, cast, mark, settle

pytestmark = pytest.mark.interpreted

ROWS, COLUMNS = 9, 13
TOUCH = 1e-9


def intervals(origin: tuple[float, float], direction: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Length at which a ray enters and leaves every cell; a miss leaves before it enters."""
    enters, leaves = [], []
    for start, along, size in zip(origin, direction, (ROWS, COLUMNS), strict=True):
        low, high = np.arange(size) - start, np.arange(size) + 1 - start
        if along == 0.0:
            inside = (low <= 0.0) & (high > 0.0)
            enter, leave = np.where(inside, -math.inf, math.inf), np.where(inside, math.inf, -math.inf)
        else:
            enter, leave = np.minimum(low / along, high / along), np.maximum(low / along, high / along)
        enters.append(enter)
        leaves.append(leave)
    enter = np.maximum(np.maximum(enters[0][:, None], enters[1][None, :]), 0.0)
    return enter, np.minimum(leaves[0][:, None], leaves[1][None, :])


def rays(count: int) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """Make rays from inside and outside, some along the axes, some from corners and edges of cells."""
    rng = np.random.default_rng(3)
    result = []
    for k in range(count):
        row, column = rng.uniform(-4, ROWS + 4), rng.uniform(-4, COLUMNS + 4)
        angle = rng.uniform(-math.pi, math.pi)
        direction = (math.cos(angle), math.sin(angle))
        if k % 4 == 1:
            direction = [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)][k // 4 % 4]
        if k % 4 == 2:
            row = float(round(row))
        if k % 8 == 3:
            row, column = float(round(row)), float(round(column))
        result.append(((row, column), direction))
    return result


RAYS = rays(400)


@pytest.mark.parametrize("length", [0.0, 3.7, 40.0])
def test_it_passes_the_cells_that_it_runs_through_and_no_other(length: float) -> None:
    for origin, direction in RAYS:
        marks = np.zeros((ROWS, COLUMNS), np.uint8)
        mark(marks, *origin, np.array([direction]), np.array([length]), np.array([-1.0]))
        enter, leave = intervals(origin, direction)
        through = (leave - enter > TOUCH) & (leave <= length)
        doubtful = (np.abs(leave - enter) <= TOUCH) | (np.abs(leave - length) <= TOUCH)
        assert (((marks == FREE) == through) | doubtful).all(), (origin, direction)
        assert not (marks == HIT).any()


def test_the_end_is_where_it_lies() -> None:
    for origin, direction in RAYS:
        marks = np.zeros((ROWS, COLUMNS), np.uint8)
        mark(marks, *origin, np.array([direction]), np.array([4.0]), np.array([5.5]))
        enter, leave = intervals(origin, direction)
        real = leave - enter > TOUCH
        free, end = real & (leave <= 4.0), real & (leave > 4.0) & (enter <= 5.5)
        doubtful = np.abs(leave - enter) <= TOUCH
        for edge in (np.abs(leave - 4.0), np.abs(enter - 5.5)):
            doubtful |= edge <= TOUCH
        assert (((marks == FREE) == free) | doubtful).all(), (origin, direction)
        assert (((marks == HIT) == end) | doubtful).all(), (origin, direction)


def test_expected_lengths_are_those_to_the_nearest_blocked_cell() -> None:
    rng = np.random.default_rng(4)
    blocked = (rng.random((ROWS, COLUMNS)) < 0.1).astype(np.uint8)
    assert blocked.any()
    origins, directions = np.array([ray[0] for ray in RAYS]), np.array([ray[1] for ray in RAYS])
    lengths = np.empty(len(RAYS))
    columns = [np.ascontiguousarray(column) for column in (*origins.T, *directions.T)]
    cast(blocked, *columns, 8.0, lengths)
    compared = 0
    for (origin, direction), length in zip(RAYS, lengths, strict=True):
        enter, leave = intervals(origin, direction)
        if ((np.abs(leave - enter) <= TOUCH) & (blocked > 0)).any():
            continue  # whether a corner is touched is a matter of the last bit
        ahead = enter[(leave - enter > TOUCH) & (blocked > 0) & (enter <= 8.0)]
        expected = ahead.min() if ahead.size else math.inf
        assert length == pytest.approx(expected, abs=1e-12), (origin, direction)
        compared += 1
    assert compared > 300


def test_a_ray_from_inside_a_blocked_cell_has_no_length() -> None:
    lengths = np.empty(1)
    one = np.ones(1)
    cast(np.ones((3, 3), np.uint8), 1.5 * one, 1.5 * one, one, 0 * one, 5.0, lengths)
    assert lengths[0] == 0.0


def test_of_two_rays_the_end_wins_over_the_passage() -> None:
    """Whatever their order: one ends in cell (0, 3), the other runs along the row to the end."""
    for order in ([0, 1], [1, 0]):
        marks = np.zeros((1, 6), np.uint8)
        directions = np.array([[0.0, 1.0], [0.0, 1.0]])
        mark(marks, 0.5, 0.5, directions, np.array([2.5, 9.0])[order], np.array([3.0, -1.0])[order])
        assert marks.tolist() == [[FREE, FREE, FREE, HIT, FREE, FREE]]


def test_marks_become_log_odds_once_within_the_window() -> None:
    marks = np.array([[0, FREE, HIT], [HIT, FREE, HIT]], np.uint8)
    log_odds = np.zeros((2, 3))
    prior = np.full((2, 3), -0.5)
    settle(log_odds, prior, marks, 0, 2, 1, 3, -1.0, 2.0, 1.9)
    assert log_odds.tolist() == [[0.0, -0.5, 1.9], [0.0, -0.5, 1.9]]
    assert marks.tolist() == [[0, 0, 0], [HIT, 0, 0]]
