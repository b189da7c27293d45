"""Cutting and merging boxes, by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from filters.tree_nodes import Side, Sides, divide, merged, root

SIDES = Sides([Side(0.0, 8.0, 1.0), Side(0.0, 1.0, 0.5, 1.0)])


def test_the_widest_in_units_of_the_finest_is_cut() -> None:
    widths = np.array([[8.0, 1.0], [2.0, 1.0], [1.0, 1.0], [1.0, 0.5], [8.0, 1.0], [1.0, 2.0]])
    heavy = np.array([True, True, True, True, False, False])
    assert SIDES.axes_to_cut(widths, heavy).tolist() == [0, 0, 1, -1, -1, 1]


def test_what_is_cut_and_merged_again_is_whole() -> None:
    nodes = root(SIDES)
    nodes = divide(nodes, np.array([0]), np.array([0]))
    nodes = divide(nodes, np.array([1, 2]), np.array([0, 1]))
    assert nodes.low.tolist() == [[0, 0], [0, 0], [4, 0], [0, 0], [2, 0], [4, 0], [4, 0.5]]
    assert nodes.high.tolist() == [[8, 1], [4, 1], [8, 1], [2, 1], [4, 1], [8, 0.5], [8, 1]]
    assert nodes.leaves.tolist() == [3, 4, 5, 6]
    assert nodes.mass[nodes.leaves].tolist() == [0.25] * 4
    nodes.mass[nodes.leaves] = [0.3, 0.1, 0.4, 0.2]
    half = merged(nodes, SIDES, 0.5)
    assert half.mass.tolist() == pytest.approx([1.0, 0.4, 0.6, 0.4, 0.2])
    assert half.axis.tolist() == [0, -1, 1, -1, -1]
    assert half.child[2] == 3
    assert merged(nodes, SIDES, 1.0).mass.tolist() == pytest.approx([1.0])


def test_nothing_is_merged_beyond_the_coarsest() -> None:
    sides = Sides([Side(0.0, 8.0, 1.0, 4.0)])
    nodes = divide(root(sides), np.array([0]), np.array([0]))
    assert merged(nodes, sides, 1.0).axis.size == 3


@pytest.mark.parametrize(
    ("low", "high", "finest", "coarsest"),
    [
        (1.0, 1.0, 0.1, math.inf),
        (math.nan, 1.0, 0.1, math.inf),
        (0.0, 1.0, 0.0, math.inf),
        (0.0, 1.0, 0.5, 0.9),
        (0.0, 1.0, 0.1, math.nan),
    ],
)
def test_a_side_that_makes_no_sense_is_refused(
    low: float, high: float, finest: float, coarsest: float
) -> None:
    with pytest.raises(ValueError, match="tree side"):
        Side(low, high, finest, coarsest)


def test_a_box_needs_a_side() -> None:
    with pytest.raises(ValueError, match="at least one side"):
        Sides([])
